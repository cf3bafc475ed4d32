"""Reports of a run: pages and tables."""
