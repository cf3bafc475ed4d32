"""DeepSpeech 0.x, read from a user's own frozen graph."""
