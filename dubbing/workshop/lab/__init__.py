"""Measurements of methods and trained models on held-out recordings."""
