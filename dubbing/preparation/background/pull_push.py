"""Fills unknown pixels by pull-push (Gortler et al. 1996, "The Lumigraph", section 3.4).

Averages over ever larger blocks of known pixels are interpolated back down into unknown ones.
"""

import cv2
import numpy as np

from dubbing.preparation.background.pixels import spread


def pull_push(image: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fill an image (H, W) or (H, W, 3) where the weight ``known`` (H, W) in 0..1 is below 1.

    Returns:
        float32 like the image: the image where known is 1, smooth in between; zeros if all is
        unknown.
    """
    channels = 1 if image.ndim == 2 else image.shape[2]
    weights = [known.astype(np.float32)]
    values = [image * spread(weights[0], channels)]
    while min(values[-1].shape[:2]) > 1:
        height, width = values[-1].shape[:2]
        half = ((width + 1) // 2, (height + 1) // 2)
        value = cv2.resize(values[-1], half, interpolation=cv2.INTER_AREA)
        weight = cv2.resize(weights[-1], half, interpolation=cv2.INTER_AREA)
        # A block with any known pixel counts as known: its mean is the best guess there is.
        full = np.minimum(4 * weight, 1)
        values.append(value * spread(full / np.maximum(weight, 1e-9), channels))
        weights.append(full)
    filled = values[-1] / spread(np.maximum(weights[-1], 1e-9), channels)
    for value, weight in zip(values[-2::-1], weights[-2::-1], strict=True):
        below = cv2.resize(filled, weight.shape[::-1], interpolation=cv2.INTER_LINEAR)
        filled = value + below * spread(1 - weight, channels)
    return np.asarray(filled)
