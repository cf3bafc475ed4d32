"""Speech features and voice activity of a sound."""
