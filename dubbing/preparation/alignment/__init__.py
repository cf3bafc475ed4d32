"""Where the head is: poses from landmarks, pixels and outlines."""
