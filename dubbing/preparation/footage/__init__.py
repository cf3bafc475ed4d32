"""The frames of a clip while it is prepared, and threads to work on them."""
