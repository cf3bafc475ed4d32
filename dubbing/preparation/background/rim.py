"""Extends the surroundings of an inpaint mask into its rim."""

import cv2
import numpy as np

from dubbing.preparation.background.pixels import chosen, rounded, spread
from dubbing.preparation.background.pull_push import pull_push

RIM_FULL, RIM_END = 5.0, 10.0  # px at S = 512 inside the mask, between which surroundings fade
CONTEXT_PX = 32  # at S = 512, round an inpaint mask, that its rim depends on


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
