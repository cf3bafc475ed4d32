"""The head matte: opacity of the head's pixels."""
