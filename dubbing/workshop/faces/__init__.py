"""Import of the networks that find faces and people."""
