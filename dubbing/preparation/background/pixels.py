"""Arithmetic on images by OpenCV, many times as fast as numpy's on three channels."""

import cv2
import numpy as np

Part = tuple[slice, slice]  # rows and columns of an image


def spread(weight: np.ndarray, channels: int = 3) -> np.ndarray:
    """A weight (H, W) float32 for every channel, (H, W, C): numpy's broadcasting is slow."""
    return weight if channels == 1 else cv2.merge((weight,) * channels)


def rounded(image: np.ndarray) -> np.ndarray:
    """A float32 image in whole levels 0..255, uint8."""
    return cv2.addWeighted(image, 1, image, 0, 0, dtype=cv2.CV_8U)


def chosen(where: np.ndarray, image: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The image (H, W, C) where `where` (H, W) bool, else the other."""
    return cv2.copyTo(image, where.astype(np.uint8), other.copy())


def extent(mask: np.ndarray, margin: int = 0) -> Part:
    """Rows and columns of an image that hold all of a mask (H, W), with a margin in px; else none.

    Only that is computed.
    """
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    row, column = (
        slice(max(0, int(at[0]) - margin), min(length, int(at[-1]) + 1 + margin))
        for at, length in zip((rows, columns), mask.shape, strict=True)
    )
    return row, column


def around(part: Part, margin: int, size: int) -> tuple[Part, Part]:
    """A part of an image of side `size` with a margin in px, and where the part lies in that."""
    rows, columns = (slice(max(0, i.start - margin), min(size, i.stop + margin)) for i in part)
    first, length = (rows.start, columns.start), [i.stop - i.start for i in part]
    down, right = (i.start - k for i, k in zip(part, first, strict=True))
    own = slice(down, down + length[0]), slice(right, right + length[1])
    return (rows, columns), own


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
