"""Putting a rendered head into a frame: face mask, neck, blending."""
