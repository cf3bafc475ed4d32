"""The manifest of a reel: shots in a folder, one script for all of them, and who is who in them."""
