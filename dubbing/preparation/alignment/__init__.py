"""Head poses from landmarks, pixels and the outline of the head."""
