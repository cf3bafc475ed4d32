"""Faults of dubbed mouths, made on the curves and crops of a real one.

Letters: F frames, M mouth points, R rows and C columns of a crop.
"""

from typing import NamedTuple

import cv2
import numpy as np
from scipy.ndimage import maximum_filter1d

from dubbing.face.mouth.mouth_shape import opening
from dubbing.sync.mouth_figures import smoothed

MOUTH_WIDTH = 31  # pixels of a crop
BLURS = (0.1, 0.2)  # standard deviations in widths of the mouth
DELAYS_MS = (80, 120, 160)  # of closures
JITTER = 0.003  # of landmarks, eye distances
GRAIN = 2.0  # of a camera, grey values


class Mouth(NamedTuple):
    """Shapes (F, M, 2), NaN without a face, and crops (F, R, C)."""

    shapes: np.ndarray
    crops: np.ndarray

    def shaped(self, shapes: np.ndarray) -> "Mouth":
        """A mouth of other shapes, each with the crop of this one's most similar frame."""
        own = np.flatnonzero(np.isfinite(self.shapes[:, 0, 0]))
        known = self.shapes[own].reshape(len(own), -1)
        wanted = np.nan_to_num(shapes).reshape(len(shapes), -1)
        apart = (known**2).sum(1) - 2 * wanted @ known.T
        return Mouth(shapes.astype(np.float32), self.crops[own[apart.argmin(1)]])

    def at(self, frames: np.ndarray) -> "Mouth":
        return Mouth(self.shapes[frames], self.crops[frames])


def mouth_faults(mouth: Mouth, loudness: np.ndarray, rate: float) -> dict[str, Mouth]:
    """Mouths with one fault each, by its name.

    Args:
        loudness: of the sound (F,), dB.
    """
    rng = np.random.default_rng(0)
    shapes = mouth.shapes
    gap, mean = opening(shapes), np.nanmean(shapes, axis=0)
    middle, spread = np.nanmean(gap), np.nanstd(gap)
    # How all points go with the opening.
    along = np.nanmean((gap - middle)[:, None, None] * (shapes - mean), axis=0) / spread**2

    def opened(wanted: np.ndarray) -> np.ndarray:
        return mean + along * (wanted - middle)[:, None, None]

    flap = smoothed(loudness)
    ranked = np.nanquantile(gap, flap.argsort().argsort() / len(flap))
    still = mouth.at(np.full(len(gap), int(np.nanargmin(np.abs(gap - np.nanmedian(gap))))))
    half_open = np.nanmedian(gap)
    never = np.maximum(half_open + 0.4 * (gap - middle), 0.8 * half_open)
    found = {
        "frozen": Mouth(
            still.shapes + rng.normal(0, JITTER, shapes.shape),
            np.clip(still.crops + rng.normal(0, GRAIN, still.crops.shape), 0, 255).astype(np.uint8),
        ),
        "flaps as far as the person": mouth.shaped(opened(smoothed(ranked))),
        "flaps with the loudness": mouth.shaped(
            opened(middle + spread * (flap - flap.mean()) / flap.std())
        ),
        "never closes": mouth.shaped(shapes + along * (never - gap)[:, None, None]),
        "half as strong": mouth.shaped(mean + 0.5 * (shapes - mean)),
        "twice as strong": mouth.shaped(mean + 2 * (shapes - mean)),
    }
    for amount in BLURS:
        soft = [cv2.GaussianBlur(crop, (0, 0), amount * MOUTH_WIDTH) for crop in mouth.crops]
        found[f"blurred, {amount} widths"] = Mouth(shapes, np.stack(soft))
    for delay in DELAYS_MS:
        found[f"closures {delay} ms late"] = mouth.at(delayed(gap, delay / 1000 * rate, rate))
    return found


def delayed(gap: np.ndarray, frames: float, rate: float) -> np.ndarray:
    """Numbers (F,) of the frames that show nearly closed lips (gap (F,)) so many frames later."""
    reach = round(0.12 * rate)
    closed = (gap < np.nanquantile(gap, 0.25)).astype(float)
    around = maximum_filter1d(closed, 2 * reach + 1, mode="nearest")
    late = np.round(frames * np.convolve(around, np.ones(5) / 5, "same")).astype(int)
    return np.clip(np.arange(len(gap)) - late, 0, len(gap) - 1)
