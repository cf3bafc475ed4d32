"""The square window that follows the head: crops are cut from it and pasted back.

S is the side of the crop in px. A window (x0, y0, side, turns) has whole numbers of source px, so
that a crop is a slice and a resize, and moving it moves the principal point by an exact amount. Its
place is that after so many quarter turns of the source, counterclockwise: a head that lies on its
side is upright in the crop.
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
    box: np.ndarray, segment: np.ndarray, turns: np.ndarray, size: tuple[int, int], rate: float
) -> np.ndarray:
    """Windows (T, 4) for face boxes (T, 4) px of a source of ``size`` (W, H).

    The side, and with it the focal length, is the same for the whole clip. It is a multiple of
    `STEP`, as a crop's is, which can so have the film's own pixels. Within a shot the window is
    fixed, or moves smoothly where the head travels.

    Args:
        turns: (T,) of each frame's shot.
    """
    from scipy.ndimage import gaussian_filter1d  # it takes longer to load than a plan to make

    width, height = size
    most = min(width, height) // STEP * STEP
    ends = [turned(b.reshape(2, 2), k, size) for b, k in zip(box, turns, strict=True)]
    box = np.concatenate((np.min(ends, axis=1), np.max(ends, axis=1)), axis=1)
    face = float(np.median(box[:, 3] - box[:, 1]))
    side = min(most, STEP * math.ceil(face / FACE_SHARE / STEP))
    if width == height and side >= WHOLE_SHARE * most:
        edge = (width - most) // 2
        return np.stack([np.array([edge, edge, most, k], float) for k in turns])
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
    room = np.where(
        turns[:, None] % 2, [height - side, width - side], [width - side, height - side]
    )
    corner = np.clip(corner.round(), 0, room)
    return np.column_stack((corner, np.full(len(box), float(side)), turns))


def within(image: np.ndarray, window: np.ndarray) -> np.ndarray:
    """The window's pixels (side, side, ...) of an image (H, W, ...), as a view of it."""
    x0, y0, side, turns = (int(v) for v in window)
    return np.rot90(image, turns)[y0 : y0 + side, x0 : x0 + side]


def crop(image: np.ndarray, window: np.ndarray, size: int) -> np.ndarray:
    """The window of an image (H, W, ...) as (S, S, ...), not resampled where side == S."""
    part = np.ascontiguousarray(within(image, window))
    if len(part) == size:
        return part
    return cv2.resize(part, (size, size), interpolation=interpolation(len(part), size))


def interpolation(source: int, target: int) -> int:
    """OpenCV's filter that neither aliases when it shrinks nor blurs when it enlarges."""
    return cv2.INTER_AREA if target < source else cv2.INTER_CUBIC


def paste(
    frame: np.ndarray, window: np.ndarray, crop_image: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A source frame (H, W, 3) with a crop image (S, S, 3) pasted in where the mask is above 0.

    Args:
        frame: uint8 source frame; it is not changed.
        window: (4,) the frame's window.
        crop_image: uint8.
        mask: (S, S) uint8, 255 for the crop image alone; lower values blend.

    Returns:
        uint8 (H, W, 3), and its mask (H, W): pixels where that is 0 equal the frame's.
    """
    out, pasted = frame.copy(), laid(mask, window, frame.shape[:2])
    below, mask = (within(image, window) for image in (out, pasted))
    side = len(mask)
    if side != len(crop_image):
        method = interpolation(len(crop_image), side)
        crop_image = cv2.resize(crop_image, (side, side), interpolation=method)
    part = extent(mask > 0)
    share = mask[part][..., None].astype(np.float32) / 255
    below[part] = (
        below[part] + share * (crop_image[part].astype(np.float32) - below[part])
    ).round()
    return out, pasted


def laid(mask: np.ndarray, window: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A mask (S, S) uint8 of a crop as one of a source frame of that shape (H, W)."""
    out = np.zeros(shape, np.uint8)
    place = within(out, window)
    side = len(place)
    if side != len(mask):
        mask = cv2.resize(mask, (side, side), interpolation=cv2.INTER_LINEAR)
    place[:] = mask
    return out


def turned(points: np.ndarray, turns: int, size: tuple[int, int]) -> np.ndarray:
    """Where pixels (..., 2) of a source of ``size`` (W, H) lie after so many quarter turns."""
    last = np.array(size) - 1
    for _ in range(int(turns) % 4):
        points = np.stack((points[..., 1], last[0] - points[..., 0]), axis=-1)
        last = last[::-1]
    return points


def to_crop(
    points: np.ndarray, window: np.ndarray, size: int, source: tuple[int, int]
) -> np.ndarray:
    """Pixels (..., 2) of a source (W, H) in px of the crop; whole numbers are middles of pixels."""
    *corner, side, turns = window
    return (turned(points, turns, source) + 0.5 - np.array(corner)) * (size / side) - 0.5
