"""Tracking: choice of the person's face, landmarks, head poses."""
