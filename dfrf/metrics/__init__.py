"""Metrics of rendered images and of lip motion."""
