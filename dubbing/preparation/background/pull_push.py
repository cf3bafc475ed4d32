"""Filling the unknown by pull-push (Gortler et al. 1996, "The Lumigraph", section 3.4).

Averages over ever larger blocks of known pixels flow back down to where nothing is known.
"""

import cv2
import numpy as np


def pull_push(image: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fill an image (H, W, C) where the weight ``known`` (H, W) in 0..1 is below 1.

    Returns:
        float32 (H, W, C): the image where known is 1, smooth in between; zeros if nothing is.
    """
    values = [image.astype(np.float32) * known[..., None]]
    weights = [known.astype(np.float32)]
    while min(values[-1].shape[:2]) > 1:
        height, width = values[-1].shape[:2]
        half = ((width + 1) // 2, (height + 1) // 2)
        value = cv2.resize(values[-1], half, interpolation=cv2.INTER_AREA)
        weight = cv2.resize(weights[-1], half, interpolation=cv2.INTER_AREA)
        # A block with any known pixel counts as known: its mean is the best guess there is.
        full = np.minimum(4 * weight, 1)
        values.append(
            value.reshape(*weight.shape, -1) * (full / np.maximum(weight, 1e-9))[..., None]
        )
        weights.append(full)
    filled = values[-1] / np.maximum(weights[-1], 1e-9)[..., None]
    for value, weight in zip(values[-2::-1], weights[-2::-1], strict=True):
        height, width = weight.shape
        below = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
        filled = value + below.reshape(value.shape) * (1 - weight)[..., None]
    return np.asarray(filled)
