"""What a run reports: pages and tables."""
