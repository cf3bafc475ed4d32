"""Films of numbered image files: how they are read and written, and their colours."""
