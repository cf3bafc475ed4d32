"""Detects cuts.

A cut is a frame whose mean absolute difference from the one before is large and stands out from
the differences around it, and whose structure is different: a lamp that is switched on changes
every pixel, but no edge.
"""

from collections.abc import Sequence

import cv2
import numpy as np

LEAST_DIFFERENCE = 5.0  # grey levels
LEAST_RATIO = 8.0  # of the difference to the local median
NEIGHBOURHOOD = 25  # frames
CLOSE = 6  # frames to both sides, in which at most two others may be nearly as large:
PEAK_RATIO = 2.5  # hands that wave cause many large differences, a cut only one
THUMBNAIL = 96  # px; noise and small motion vanish at this size
REPEATED = 0.02  # grey levels: below this a frame repeats the one before
# Correlation of two structures, above which they show one scene. Measured: 0.84 to 0.98 where the
# light changes, at most 0.44 at jump cuts of one person before one wall.
SAME_STRUCTURE = 0.65
FINE = 2.0  # px of a thumbnail, Gaussian: coarser structure is light
GRAIN = 2.0  # grey levels: structure weaker than this is noise
FLASH = 8  # frames that a flash lasts at the most
BRIGHTER = 0.97  # share of its pixels that are brighter than before it


def thumbnail(image: np.ndarray) -> np.ndarray:
    """A small grey image (96, 96) float32 of an RGB frame, for comparing frames."""
    small = cv2.resize(image, (THUMBNAIL, THUMBNAIL), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float32)


def structure(small: np.ndarray) -> np.ndarray:
    """Edges of a thumbnail (H, W), normalised to equal strength in dark and light."""
    fine = small - cv2.GaussianBlur(small, (0, 0), FINE)
    strength = np.sqrt(cv2.GaussianBlur(fine * fine, (0, 0), FINE))
    return np.asarray(fine / (strength + GRAIN))


def same_structure(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two thumbnails (H, W) show one scene, in the same or another light."""
    a, b = structure(one), structure(other)
    norm = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return norm > 0 and float((a * b).sum()) > SAME_STRUCTURE * norm


def flashed(recent: Sequence[np.ndarray], small: np.ndarray) -> int:
    """How many frames before this one a flash has whitened, which shows the scene again; else 0.

    Args:
        recent: thumbnails (H, W) of the frames before. small: of this one.
    """
    means = [frame.mean() for frame in recent]
    for count in range(1, len(recent)):
        before, *white = recent[len(recent) - count - 1 :]
        least = means[len(recent) - count - 1] + LEAST_DIFFERENCE
        bright = max(means[-count:]) > least and all(
            (frame > before - GRAIN).mean() > BRIGHTER for frame in white
        )
        if bright and same_structure(before, small):
            return count
    return 0


def find_cuts(difference: np.ndarray, lit: np.ndarray | None = None) -> np.ndarray:
    """Frames that start a new shot.

    Args:
        difference: (T,) mean absolute difference to the frame before, in grey levels; [0] is 0.
        lit: (T,) bool, the frame shows the scene of the one before in another light: no cut.

    Returns:
        Sorted indices of the first frames after a cut; never 0.
    """
    cuts = []
    half = NEIGHBOURHOOD // 2
    large = difference > LEAST_DIFFERENCE
    for frame in map(int, np.flatnonzero(large if lit is None else large & ~lit)):
        low, high = max(1, frame - half), frame + half + 1
        around = np.delete(difference[low:high], frame - low)
        median = float(np.median(around)) if len(around) else 0.0
        close = np.delete(
            difference[max(1, frame - CLOSE) : frame + CLOSE + 1], min(frame - 1, CLOSE)
        )
        third = float(np.sort(close)[-3]) if len(close) >= 3 else 0.0
        if difference[frame] > max(LEAST_RATIO * median, PEAK_RATIO * third):
            cuts.append(frame)
    return np.array(cuts, int)


def segments(frames: int, cuts: np.ndarray) -> np.ndarray:
    """Number of the shot of every frame, (T,) int: 0, 1, 2 ..."""
    out = np.zeros(frames, int)
    out[cuts] = 1
    return np.asarray(np.cumsum(out))
