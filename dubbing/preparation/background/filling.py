"""Fills an inpaint mask, and any pixels that are not known, from what surrounds them."""

import cv2
import numpy as np

from dubbing.preparation.background.pixels import chosen, rounded, spread

RIM_FULL, RIM_END = 5.0, 10.0  # px at S = 512 inside the mask, between which surroundings fade
CONTEXT_PX = 32  # at S = 512, round an inpaint mask, that its rim depends on


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


def rim(
    image: np.ndarray,
    region: np.ndarray,
    person: np.ndarray,
    growing: tuple[np.ndarray, np.ndarray],
    unit: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The neck in the inpaint mask, with the surroundings of the mask blended into its rim.

    The neck is extended from below. Beside a jaw that rises steeply more of it, a collar or hair
    lies just across the edge of the inpaint mask.

    Args:
        image: (H, W, 3) uint8, around the region. region: (H, W) bool inpaint mask.
        person: (H, W) mask, 0..1. growing: colour (H, W, 3) and share (H, W) of the :func:`neck`.
        unit: px of the crop for one at S = 512.
    """
    colour, share = growing
    if not region.any() or region.all():
        return growing
    distance = cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, 5)
    # Not the nearest pixel, but a mean of more pixels further in: otherwise streaks show.
    beside = pull_push(image, np.where(region, 0, person))
    theirs = pull_push(person, (~region).astype(np.float32))
    near = np.clip((RIM_END * unit - distance) / ((RIM_END - RIM_FULL) * unit), 0, 1) * region
    there = (near * theirs).astype(np.float32)
    return colour + spread(there) * (beside - colour), np.maximum(share, there)


def restore(
    image: np.ndarray, region: np.ndarray, wall: np.ndarray, growing: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """The frame without its head: (H, W, 3) uint8, equal to the image outside of the region.

    Args:
        image: (H, W, 3) uint8, around the region. region: (H, W) bool inpaint mask.
        wall: (H, W, 3) float32, the plate in the light of the frame.
        growing: colour and share of the neck in the inpaint mask, as of :func:`rim`.
    """
    colour, share = growing
    return chosen(region, rounded(wall + spread(share) * (colour - wall)), image)
