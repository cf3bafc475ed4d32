"""Predicts the motion of lips from the sound of speech, for any speaker."""
