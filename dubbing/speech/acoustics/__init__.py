"""What is spoken: a recurrent acoustic network and what it makes of a sound."""
