"""The video of a dub: heads onto the film, marks, encoding, sound, and a last check."""
