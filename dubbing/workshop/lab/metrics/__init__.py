"""Measures of images and lips, for `dfrf evaluate`."""
