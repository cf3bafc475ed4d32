"""Rendering: rays through an occupancy grid, volume rendering (8), whole frames, poses."""
