"""The dubbing batch around the radiance field: files, processes, people."""
