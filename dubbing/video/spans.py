"""Frames in a row that have something in common."""

from collections.abc import Iterator

import numpy as np


def spans(chosen: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and stop of each row of chosen frames (F,) bool."""
    edges = np.flatnonzero(np.diff(chosen, prepend=False, append=False)).reshape(-1, 2)
    yield from ((int(first), int(stop)) for first, stop in edges)
