"""The motion of lips in speech, learned from many people, whoever speaks."""
