"""Blind pairs of dubs: people say which looks more like a person who speaks, and what follows."""
