"""The base checkpoint that ships with the package, and the format of shipped weights."""
