"""The sync check: whether a mouth follows its sound, by how much it is off, and the verdict."""
