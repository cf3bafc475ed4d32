"""Restores the background behind the head: wall, torso and neck."""
