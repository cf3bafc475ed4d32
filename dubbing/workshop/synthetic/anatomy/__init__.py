"""The synthetic head: shape, skin, eyes, hair."""
