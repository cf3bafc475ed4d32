"""Restores the background behind the head: wall, torso, and what surrounds it."""
