"""How everything that ships was trained."""
