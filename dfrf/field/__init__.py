"""Colour and density at a point, equations (1) to (7), from speech and reference views."""
