"""How far the film's outline lies beside that of a learned head that says the film's words.

A jaw is higher or lower than lips say, and a pose is a little off: the outlines lie some pixels
apart. With other words it is so as well. S is the side of the crop in px, K angles. Lengths are for
S = 512 and scale with it.
"""

import warnings
from collections.abc import Sequence

import cv2
import numpy as np

from dubbing.compositing.face_mask import jaw_share
from dubbing.face.face_contour import FaceContour
from dubbing.preparation.matting.matting import REFERENCE_SIZE

ANGLES = np.arange(48) * (2 * np.pi / 48)  # at the middle of the face, from the image's right down
STEP = 1.0  # px along a ray
HALF = 127.5  # of 255: opacity at the outline
MOST = 16.0  # px that outlines differ
UNLIKE = 30.0  # px: an outline so far away is another thing's


def radii(opacity: np.ndarray, middle: np.ndarray, angles: np.ndarray = ANGLES) -> np.ndarray:
    """How far the outline of a head (S, S) uint8 is from the middle (2,) at angles (K,), (K,) px.

    NaN where there is no head in that direction.
    """
    way = np.arange(0, len(opacity), STEP, dtype=np.float32)
    x, y = (
        (k + turn(angles)[:, None] * way).astype(np.float32)
        for k, turn in zip(middle, (np.cos, np.sin), strict=True)
    )
    along = cv2.remap(opacity, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    seen = along.astype(np.float32)
    inside = seen >= HALF
    last = len(way) - 1 - inside[:, ::-1].argmax(1)
    ray, after = np.arange(len(angles)), np.minimum(last + 1, len(way) - 1)
    fall = np.maximum(seen[ray, last] - seen[ray, after], 1)
    part = np.clip((seen[ray, last] - HALF) / fall, 0, 1)
    return np.where(inside.any(1), way[last] + STEP * part, np.nan)


def beside(film: np.ndarray, head: np.ndarray, contour: FaceContour) -> np.ndarray:
    """How far the film's outline lies beyond a head's, (K,) px; NaN where that says nothing.

    Args:
        film, head: (S, S) uint8, opacities; the head has the film's lips.
        contour: of the film's face.
    """
    unit = len(film) / REFERENCE_SIZE
    apart = radii(film, contour.middle) - radii(head, contour.middle)
    apart[(jaw_share(contour, ANGLES) == 0) | ~(np.abs(apart) < UNLIKE * unit)] = np.nan
    return np.clip(apart, -MOST * unit, MOST * unit)


def jaw_lines(looked: np.ndarray, jaws: Sequence[np.ndarray], frames: np.ndarray) -> np.ndarray:
    """Offsets of the jaw line (F, K) px of frames (F,) of a shot; 0 where they are not known.

    Args:
        looked: (N,) frames that were compared. jaws: of each, (K,), see `beside`.
    """
    out = np.zeros((len(frames), len(ANGLES)), np.float32)
    if not len(looked):
        return out
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of medians of nothing
        padded = np.pad(np.stack(jaws), ((1, 1), (0, 0)), constant_values=np.nan)
        steady = np.nanmedian([padded[k : k + len(looked)] for k in range(3)], 0)
        even = np.nanmedian([np.roll(steady, k, 1) for k in (-1, 0, 1)], 0)
    for k, column in enumerate(even.T):
        known = np.isfinite(column)
        if known.any():
            out[:, k] = np.interp(frames, looked[known], column[known])
    return out
