"""The mean texture of the face over the frames, normalised to one light.

Its slopes are means, too: those of one frame are noisy, and steps computed from them are too short
(errors in variables; the mean is the template of Baker and Matthews 2004). T frames, N points.
"""

from dataclasses import dataclass

import numpy as np

from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.alignment.photometric import Alignment, in_chunks

NOISE = 4.0  # grey levels: of a pixel whose texture does not change at all


@dataclass(frozen=True)
class Texture:
    """The mean texture of the face.

    mean: grey values (N,), and inverse variances weight (N,), 0 where never visible. slope (N, 3):
    gradient of the grey value along the head's axes.
    """

    mean: np.ndarray
    weight: np.ndarray
    slope: np.ndarray


def texture_of(poses: Poses, frames: np.ndarray, work: Alignment) -> Texture:
    """Mean texture of some frames: temporal median, weight 1 / (MAD^2 + 4^2).

    Frames are first normalised to a common mean and contrast.
    """
    values = work.samples(poses, frames)
    mean = np.nanmean(values, axis=1, keepdims=True)
    contrast = np.nanstd(values, axis=1, keepdims=True) / np.median(np.nanstd(values, axis=1))
    even = (values - mean) / contrast + np.median(mean)
    visible = np.isfinite(even).mean(0) > 0.5
    even = np.where(visible, even, 0)
    texture = median_of_known(even)
    spread = median_of_known(np.abs(even - texture))
    weight = np.where(visible, 1 / (spread**2 + NOISE**2), 0)

    of_frame = np.ones(len(poses))
    of_frame[frames] = contrast[:, 0]

    def slopes(part: np.ndarray) -> np.ndarray:
        view = work.view(poses, part)
        by_pixel = work.strip.slopes(part, view.pixels) * (work.focal / view.in_camera[..., 2:])
        ahead = (by_pixel * view.in_camera[..., :2]).sum(-1) / view.in_camera[..., 2]
        by_place = np.concatenate((by_pixel, -ahead[..., None]), axis=2)
        by_place[~view.visible] = 0
        turned = np.nan_to_num(by_place @ view.turns.transpose(0, 2, 1))
        return np.asarray((turned / of_frame[part, None, None]).sum(0))

    count = np.maximum(np.isfinite(values).sum(0), 1)
    return Texture(texture, weight, sum(in_chunks(slopes, frames)) / count[:, None])


def median_of_known(values: np.ndarray) -> np.ndarray:
    """Median (N,) over time of values (T, N) that are not NaN; numpy's is many times slower."""
    order = np.sort(values.T, axis=1)  # NaN last
    last = np.isfinite(values).sum(0) - 1
    low, high = (np.take_along_axis(order, (k // 2)[:, None], 1)[:, 0] for k in (last, last + 1))
    return np.asarray((low + high) / 2)
