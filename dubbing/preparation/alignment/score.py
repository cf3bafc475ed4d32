"""Score of a track: the motion of the upper face that remains once the poses are removed.

K frames, N points.
"""

import numpy as np

from dubbing.preparation.alignment.banded import huber_weight
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.alignment.photometric import Alignment, in_chunks
from dubbing.preparation.alignment.refinement import without_gain
from dubbing.preparation.alignment.texture import texture_of

STEPS = 5


def residual_shift(poses: Poses, frames: np.ndarray, work: Alignment) -> np.ndarray:
    """Remaining motion of the upper face once the poses are removed: (K, 2) px a frame.

    Every frame's skin, from one view, is compared with the mean of the given frames: the result is
    the shift that best explains the difference, with gain and offset free. Its root mean square is
    the score of a track. Landmarks cannot give it, as they jitter themselves. Points are weighted
    as in the refinement, by how steady they are and by Huber's loss: a forehead that wrinkles under
    raised brows moves on the skull, which is no error of the pose.
    """
    texture = texture_of(poses, frames, work)

    def shifts(part: np.ndarray) -> np.ndarray:
        view = work.view(poses, part)
        values, slopes = work.values(part, view), work.strip.slopes(part, view.pixels)
        columns = np.concatenate((slopes, values[..., None]), axis=2)
        known = np.isfinite(columns.sum(2))
        weight = np.where(known, texture.weight, 0)
        columns[~known] = 0
        clean, _ = without_gain(columns, texture.mean, weight)
        slopes, difference = clean[..., :2], clean[..., 2]
        out = np.zeros((len(part), 2, 1), np.float32)
        for _ in range(STEPS):
            left = difference + (slopes @ out)[..., 0]
            sure = weight * huber_weight(np.abs(left) * np.sqrt(weight))
            weighted = (slopes * sure[..., None]).transpose(0, 2, 1)
            # A point shifted by d shows the texture at d before it, hence the sign.
            out = -np.linalg.solve(weighted @ slopes, weighted @ difference[..., None])
        return out[..., 0]

    return np.concatenate(list(in_chunks(shifts, frames)))


def root_mean_square(shift: np.ndarray) -> float:
    """Root mean square of the lengths of shifts (K, 2), px; rows of NaN do not count."""
    return float(np.sqrt(np.nanmean((shift**2).sum(1))))
