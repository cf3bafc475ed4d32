"""The median in time of pixels that only some frames show."""

import numpy as np


def known_median(images: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Median (H, W, C) float32 of the known pixels of K images; arbitrary where none is known.

    Args:
        images: (K, H, W, C) uint8. known: (K, H, W) bool.
    """
    out = np.zeros(images.shape[1:], np.float32)
    count = known.sum(0)
    for row in range(images.shape[1]):  # row by row: constant memory
        order = np.sort(np.where(known[:, row, :, None], images[:, row], 255), axis=0)
        middle = np.maximum(count[row] - 1, 0)
        low = np.take_along_axis(order, (middle // 2)[None, :, None], 0)[0]
        high = np.take_along_axis(order, ((middle + 1) // 2)[None, :, None], 0)[0]
        out[row] = (low.astype(np.float32) + high) / 2
    return out
