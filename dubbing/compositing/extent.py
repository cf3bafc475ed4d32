"""The part of an image that holds all of a mask: only that is computed."""

import numpy as np


def extent(mask: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns from the first to the last that hold any of a mask (H, W); else none."""
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
