"""The `fast` preset: its model, its loss, and how it is trained and rendered."""
