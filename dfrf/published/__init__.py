"""The `paper` preset: the method in the published sizes, and import of its checkpoints."""
