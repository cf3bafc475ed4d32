"""A script: which words are spoken from when to when, by whom, and how that is written down."""
