"""Speech features and voice activity of audio."""
