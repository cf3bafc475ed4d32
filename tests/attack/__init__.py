"""Bad input of every kind, made by hypothesis; one rule says what may come of it: `rule.py`."""
