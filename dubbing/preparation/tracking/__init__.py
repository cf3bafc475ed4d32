"""Which face is the person, and where its landmarks are."""
