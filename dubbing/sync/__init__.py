"""Whether the mouth in a video fits its sound, and by how much the two are offset."""
