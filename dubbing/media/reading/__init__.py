"""How frames and audio are read."""
