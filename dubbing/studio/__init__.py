"""A page on this machine on which the lips of a dub are edited, and their draft is seen at once."""
