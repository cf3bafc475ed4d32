"""Which pixels are the head."""
