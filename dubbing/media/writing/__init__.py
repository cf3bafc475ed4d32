"""How frames and audio are written into a file."""
