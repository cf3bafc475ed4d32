"""Where faces, hands and their landmarks are in an image, and from frame to frame."""
