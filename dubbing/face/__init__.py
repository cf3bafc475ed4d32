"""Faces: tracking, landmarks, and the shape and crop of the mouth."""
