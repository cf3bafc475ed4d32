"""Training of the filter from speech to lips."""
