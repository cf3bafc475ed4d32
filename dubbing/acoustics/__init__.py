"""What is spoken: a recurrent acoustic network, how it is taught, and how well it hears."""
