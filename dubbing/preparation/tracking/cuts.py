"""Where the film was cut.

A cut is a frame whose mean absolute difference from the one before is large and stands out from
the differences around it.
"""

import cv2
import numpy as np

LEAST_DIFFERENCE = 5.0  # grey levels
LEAST_RATIO = 8.0  # of the difference to the local median
NEIGHBOURHOOD = 25  # frames
CLOSE = 6  # frames to both sides, in which at most two others may be nearly as large:
PEAK_RATIO = 2.5  # hands that start to wave go on waving, a cut is over at once
THUMBNAIL = 96  # px; noise and small motion vanish at this size
REPEATED = 0.02  # grey levels: below this a frame repeats the one before


def thumbnail(image: np.ndarray) -> np.ndarray:
    """A small grey picture (96, 96) float32 of an RGB frame, for comparing frames."""
    small = cv2.resize(image, (THUMBNAIL, THUMBNAIL), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float32)


def find_cuts(difference: np.ndarray) -> np.ndarray:
    """Frames that begin a new shot.

    Args:
        difference: (T,) mean absolute difference to the frame before, in grey levels; [0] is 0.

    Returns:
        Sorted indices of the first frames after a cut; never 0.
    """
    cuts = []
    half = NEIGHBOURHOOD // 2
    for frame in map(int, np.flatnonzero(difference > LEAST_DIFFERENCE)):
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
