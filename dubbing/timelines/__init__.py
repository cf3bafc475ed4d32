"""Timelines of editing programs: which frames of which films a cut uses, and the cut with dubs."""
