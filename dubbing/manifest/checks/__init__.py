"""Whether a manifest can be carried out: its files, sounds, consents and results."""
