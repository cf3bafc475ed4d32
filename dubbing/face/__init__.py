"""Faces: the points of their mesh, and the contour of it."""
