"""The wall behind a person: its median over a shot, in the light of each frame.

S is the side of the crop in px.
"""

import cv2
import numpy as np

from dubbing.preparation.background.filling import pull_push
from dubbing.preparation.background.pixels import known_median
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

PERSON_LEAST = 0.1  # of the person mask: below this a pixel belongs to the background
PERSON_MARGIN = 9  # px at S = 512
COARSE = 8  # the slow difference of frame and plate is computed at 1 / COARSE of the size


def background_pixels(person: np.ndarray) -> np.ndarray:
    """Pixels (S, S) bool that surely show no person, from the person mask (S, S) uint8."""
    margin = PERSON_MARGIN * len(person) / REFERENCE_SIZE
    return ~dilate(person > PERSON_LEAST * 255, margin)


def plate(images: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Background (H, W, 3) float32: temporal median of known pixels, pull-push elsewhere.

    Args:
        images: (K, H, W, 3) uint8, one camera. known: (K, H, W) bool.
    """
    ever_known = np.any(known, axis=0).astype(np.float32)
    return pull_push(known_median(images, known), np.asarray(ever_known))


def halved(image: np.ndarray) -> np.ndarray:
    """An image (H, W[, C]) of half the size; its px x lies at 2 x + .5 of the image."""
    side = image.shape[1] // 2, image.shape[0] // 2
    return cv2.resize(image, side, interpolation=cv2.INTER_AREA)


def all_of(mask: np.ndarray) -> np.ndarray:
    """Pixels of a mask (H, W) bool of half the size all of which are in it."""
    return np.asarray(halved(np.where(mask, np.uint8(255), np.uint8(0))) == 255)


def slow_difference(
    image: np.ndarray, behind: np.ndarray, known: np.ndarray, size: int
) -> np.ndarray:
    """Low-frequency part (S, S, 3) of image - plate, extended into unknown pixels.

    Args:
        image: (H, H, 3) uint8, perhaps `halved`. behind: (H, H, 3), the plate. known: (H, H) bool.
        size: S.
    """
    small = (max(1, size // COARSE),) * 2
    mask = known.astype(np.uint8)
    difference = cv2.copyTo(cv2.subtract(image, behind, dtype=cv2.CV_32F), mask)
    weight = cv2.resize(mask.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    total = cv2.resize(difference, small, interpolation=cv2.INTER_AREA)
    mean = total / np.maximum(weight, 1e-6)[..., None]
    slow = pull_push(mean, np.where(weight > 0.2, 1.0, 0.0))
    slow = cv2.GaussianBlur(slow, (0, 0), 1.5)
    return cv2.resize(slow, (size, size), interpolation=cv2.INTER_CUBIC)
