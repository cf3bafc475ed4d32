"""The square window that follows the head: crops are cut from it and pasted back.

S is the side of the crop in px. A window (x0, y0, side) has whole numbers of source px, so that a
crop is a slice and a resize, and moving it moves the principal point by an exact amount.
"""

import math
from itertools import pairwise

import cv2
import numpy as np

from dubbing.preparation.background.pixels import extent

FACE_SHARE = 0.5  # of the window's height, for the face from the forehead to the chin
FACE_HEIGHT_AT = 0.55  # of the window's height, for the middle of the face: hair needs room above
WHOLE_SHARE = 0.8  # a square source is used whole where the window would be this share of it
STEP = 8  # px: sides of crops are multiples of it
STILL_SHARE = 0.25  # of the side: for a head that moves less the window is fixed
SMOOTH_SECONDS = 1.0


def choose_windows(
    box: np.ndarray, segment: np.ndarray, size: tuple[int, int], rate: float
) -> np.ndarray:
    """Windows (T, 3) x0, y0, side, for face boxes (T, 4) in a source of ``size`` (W, H).

    The side, and with it the focal length, is the same for the whole clip. It is a multiple of
    `STEP`, as a crop's is, which can so have the film's own pixels. Within a shot the window is
    fixed, or moves smoothly where the head travels.
    """
    from scipy.ndimage import gaussian_filter1d  # it takes longer to load than a plan to make

    width, height = size
    most = min(width, height) // STEP * STEP
    face = float(np.median(box[:, 3] - box[:, 1]))
    side = min(most, STEP * math.ceil(face / FACE_SHARE / STEP))
    if width == height and side >= WHOLE_SHARE * most:
        return np.tile([(width - most) // 2, (height - most) // 2, float(most)], (len(box), 1))
    x0 = (box[:, 0] + box[:, 2]) / 2 - side / 2
    y0 = (box[:, 1] + box[:, 3]) / 2 - FACE_HEIGHT_AT * side
    corner = np.stack((x0, y0), axis=1)
    for first, last in pairwise(np.flatnonzero(np.diff(segment, prepend=-1, append=-2))):
        shot = corner[first:last]
        for axis in range(2):
            low, high = np.percentile(shot[:, axis], [1, 99])
            if high - low < STILL_SHARE * side:
                shot[:, axis] = (low + high) / 2
            else:
                shot[:, axis] = gaussian_filter1d(
                    shot[:, axis], SMOOTH_SECONDS * rate, mode="nearest"
                )
    corner = np.clip(corner.round(), 0, [width - side, height - side])
    return np.concatenate((corner, np.full((len(box), 1), float(side))), axis=1)


def crop(image: np.ndarray, window: np.ndarray, size: int) -> np.ndarray:
    """The window of an image (H, W, ...) as (S, S, ...), not resampled where side == S."""
    x0, y0, side = (int(v) for v in window)
    part = image[y0 : y0 + side, x0 : x0 + side]
    if side == size:
        return np.ascontiguousarray(part)
    return cv2.resize(part, (size, size), interpolation=interpolation(side, size))


def interpolation(source: int, target: int) -> int:
    """OpenCV's filter that neither aliases when it shrinks nor blurs when it enlarges."""
    return cv2.INTER_AREA if target < source else cv2.INTER_CUBIC


def paste(
    frame: np.ndarray, window: np.ndarray, crop_image: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A source frame (H, W, 3) with a crop image (S, S, 3) pasted in where the mask is above 0.

    Args:
        frame: uint8 source frame; it is not changed.
        window: (3,) the frame's window.
        crop_image: uint8.
        mask: (S, S) uint8, 255 for the crop image alone; lower values blend.

    Returns:
        uint8 (H, W, 3), and its mask (H, W): pixels where that is 0 equal the frame's.
    """
    x0, y0, side = (int(v) for v in window)
    if side != len(crop_image):
        method = interpolation(len(crop_image), side)
        crop_image = cv2.resize(crop_image, (side, side), interpolation=method)
    out, pasted = frame.copy(), laid(mask, window, frame.shape[:2])
    below, mask = (image[y0 : y0 + side, x0 : x0 + side] for image in (out, pasted))
    part = extent(mask > 0)
    share = mask[part][..., None].astype(np.float32) / 255
    below[part] = (
        below[part] + share * (crop_image[part].astype(np.float32) - below[part])
    ).round()
    return out, pasted


def laid(mask: np.ndarray, window: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A mask (S, S) uint8 of a crop as one of a source frame of that shape (H, W)."""
    x0, y0, side = (int(v) for v in window)
    if side != len(mask):
        mask = cv2.resize(mask, (side, side), interpolation=cv2.INTER_LINEAR)
    out = np.zeros(shape, np.uint8)
    out[y0 : y0 + side, x0 : x0 + side] = mask
    return out


def to_crop(points: np.ndarray, window: np.ndarray, size: int) -> np.ndarray:
    """Pixels (..., 2) of the source in px of the crop; whole numbers are middles of pixels."""
    x0, y0, side = window
    return (points + 0.5 - np.array([x0, y0])) * (size / side) - 0.5
