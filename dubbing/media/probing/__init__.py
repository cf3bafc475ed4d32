"""How the properties of a file are found out."""
