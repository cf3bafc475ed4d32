"""What a manifest contains, and what is wrong with it."""
