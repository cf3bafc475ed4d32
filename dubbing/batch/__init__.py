"""A run: the jobs of a manifest, what they will take, and what becomes of them."""
