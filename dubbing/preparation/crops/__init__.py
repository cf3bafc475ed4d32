"""Crops of a clip while it is prepared, and threads that process them."""
