"""A manifest whose names, files and defaults are resolved: people, dubs, and the files they use."""
