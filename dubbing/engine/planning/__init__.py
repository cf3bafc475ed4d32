"""How much there is to do, and how long it takes."""
