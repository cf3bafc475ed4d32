"""Arithmetic on images by OpenCV, many times as fast as numpy's on three channels."""

import cv2
import numpy as np


def spread(weight: np.ndarray, channels: int = 3) -> np.ndarray:
    """A weight (H, W) float32 for every channel, (H, W, C): numpy's broadcasting is slow."""
    return weight if channels == 1 else cv2.merge((weight,) * channels)


def rounded(image: np.ndarray) -> np.ndarray:
    """A float32 image in whole levels 0..255, uint8."""
    return cv2.addWeighted(image, 1, image, 0, 0, dtype=cv2.CV_8U)


def chosen(where: np.ndarray, image: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The image (H, W, C) where `where` (H, W) bool, else the other."""
    return cv2.copyTo(image, where.astype(np.uint8), other.copy())


def box_of(region: np.ndarray, margin: int) -> tuple[slice, slice]:
    """Rows and columns of the box of a region (H, W) bool, not empty, with a margin in px."""
    rows, columns = (np.flatnonzero(region.any(axis)) for axis in (1, 0))
    row, column = (
        slice(max(0, int(index[0]) - margin), min(length, int(index[-1]) + 1 + margin))
        for index, length in ((rows, region.shape[0]), (columns, region.shape[1]))
    )
    return row, column
