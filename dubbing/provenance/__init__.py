"""Marks of origin: consent, labels, metadata, signed credentials, the invisible mark."""
