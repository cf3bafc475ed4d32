"""The sync check: whether a mouth follows its sound, and the offset between the two."""
