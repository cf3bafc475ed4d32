"""Whether the mouth in a video says what its sound says, and how far the two are apart."""
