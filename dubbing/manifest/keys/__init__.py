"""Which keys a manifest has, and what may stand in them."""
