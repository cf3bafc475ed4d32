"""Fills an inpaint mask, and any pixels that are not known, from what surrounds them."""

import cv2
import numpy as np

from dubbing.preparation.background.pixels import chosen, rounded, spread

CONTEXT_PX = 32  # at S = 512, round an inpaint mask, that its filling depends on


def pull_push(image: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fill an image (H, W) or (H, W, 3) where the weight ``known`` (H, W) in 0..1 is below 1.

    By pull-push (Gortler et al. 1996, "The Lumigraph", section 3.4): averages over ever larger
    blocks of known pixels are interpolated back down into unknown ones.

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


def restore(
    image: np.ndarray, region: np.ndarray, person: np.ndarray, wall: np.ndarray
) -> np.ndarray:
    """The frame without its head: (H, W, 3) uint8, equal to the image outside of the region.

    Neck and clothes beside the head go on into its place, the more of them the nearer they are; the
    rest is wall.

    Args:
        image: (H, W, 3) uint8, around the region. region: (H, W) bool, to be restored.
        person: (H, W) mask, 0..1. wall: (H, W, 3) float32, the plate in the light of the frame.
    """
    # Not the nearest pixel, but a mean of more pixels further away: otherwise streaks show.
    beside = pull_push(image, np.where(region, 0, person))
    share = pull_push(person, (~region).astype(np.float32))
    return chosen(region, rounded(wall + spread(share) * (beside - wall)), image)
