"""Training and evaluation of the network of the sync check."""
