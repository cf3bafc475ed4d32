"""The properties of a media file: size, rate, colours, and the values of its pixels."""
