"""Which frames of a film the lines of a script are."""
