"""Figures of a speaking mouth: how far, how fast and when it moves, and how sharp it looks.

Letters: F frames, M mouth points, R rows and C columns of a crop.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import maximum_filter1d

from dubbing.face.mouth.mouth_shape import opening
from dubbing.sync.curves import MAX_OFFSET
from dubbing.sync.result import Figures

# A frame is silent without voice for this long before and after, so that closing lips do not count.
SILENT_MARGIN = 0.3
MIN_SILENCE = 1.0
MIN_SPEECH = 1.0
SPOKEN = 0.5  # voice from which on somebody speaks
# Speed of an opening that moves, eye distances a second; landmarks of a still one shake by .03.
MOVING_SPEED = 0.1
FINE = 1.0  # standard deviation, in pixels of a crop, of the blur that takes fine detail away


@dataclass(frozen=True)
class MouthSeries:
    """The mouth of one face in F frames, and the sound at them; NaN without a face.

    Attributes:
        opening: in eye distances.
        speed: of lips and chin, over three frames.
        sharpness: power of fine detail over that of all edges.
        voice, loudness: of the sound, 0..1 and dB.
        asked, touching: the opening that the sound asks for, and a score of touching lips.
    """

    rate: float
    opening: np.ndarray
    speed: np.ndarray
    sharpness: np.ndarray
    voice: np.ndarray
    loudness: np.ndarray
    asked: np.ndarray
    touching: np.ndarray


def smoothed(values: np.ndarray) -> np.ndarray:
    """Means (F, ...) over three frames: landmarks jitter, mouths move more slowly."""
    smooth = values.copy()
    smooth[1:-1] = (values[:-2] + values[1:-1] + values[2:]) / 3
    return smooth


def pace(values: np.ndarray, rate: float) -> np.ndarray:
    """How fast smoothed values (F, ...) change, (F,) a second; NaN in the first frame."""
    step = np.diff(smoothed(values).reshape(len(values), -1), axis=0)
    return np.append(np.nan, np.linalg.norm(step, axis=1)) * rate


def of_mouth(shapes: np.ndarray, crops: np.ndarray, rate: float) -> np.ndarray:
    """Opening, speed and sharpness (3, F) of mouth shapes (F, M, 2) and crops (F, R, C)."""
    sharpness = np.full(len(shapes), np.nan)
    for k in np.flatnonzero(np.isfinite(shapes[:, 0, 0])):
        grey = crops[k].astype(np.float32)
        fine = grey - cv2.GaussianBlur(grey, (0, 0), FINE)
        across, down = np.diff(grey, axis=1)[:-1], np.diff(grey, axis=0)[:, :-1]
        sharpness[k] = np.mean(fine**2) / max(float(np.mean(across**2 + down**2)), 1e-9)
    return np.stack([opening(shapes), pace(shapes, rate), sharpness])


def silent_frames(voice: np.ndarray, rate: float) -> np.ndarray:
    """Frames (F,) bool without voice (F,) from 0.3 s before to 0.3 s after."""
    reach = max(1, round(SILENT_MARGIN * rate))
    return np.asarray(maximum_filter1d(voice, 2 * reach + 1, mode="nearest") == 0)


def correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Pearson's, 0 where one of two series does not change."""
    a, b = first - first.mean(), second - second.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 1e-9 else 0.0


def moved(values: np.ndarray, frames: int) -> np.ndarray:
    """A series (F,) that comes so many frames later; NaN before it begins or after it ends."""
    out = np.full(len(values), np.nan)
    low, high = max(frames, 0), len(values) + min(frames, 0)
    out[low:high] = values[low - frames : high - frames]
    return out


def mouth_figures(
    series: MouthSeries, chosen: np.ndarray, curve: np.ndarray, offset: int = 0
) -> Figures | None:
    """Figures of the `chosen` frames (F,) bool; None for lack of speech.

    Args:
        curve: distance to the sound at every offset (K,).
        offset: frames by which the sound comes early; it is moved back.
    """
    mouth, rate = smoothed(series.opening), series.rate
    voice, loudness, wanted, rush, touching = (
        moved(sound, offset)
        for sound in (
            series.voice,
            smoothed(series.loudness),
            smoothed(series.asked),
            pace(series.asked, rate),
            series.touching,
        )
    )
    seen = chosen & np.isfinite(mouth + series.speed + voice + rush)
    speech = seen & (voice > SPOKEN)
    if speech.sum() < MIN_SPEECH * rate or not np.isfinite(curve).all():
        return None
    centre = MAX_OFFSET + offset
    nearest = curve[max(centre - 1, 0) : centre + 2].min()
    closed = -np.minimum(series.opening, np.median(series.opening[seen]))
    silent = seen & silent_frames(np.nan_to_num(voice), rate)
    moving = pace(series.opening, rate)[silent] > MOVING_SPEED
    return Figures(
        certainty=float(np.median(curve) - nearest),
        opening=correlation(mouth[seen], wanted[seen]),
        closures=correlation(closed[speech], touching[speech]),
        spread=float(mouth[speech].std()),
        range=float(mouth[speech].std() / max(wanted[speech].std(), 1e-6)),
        speed=float(series.speed[speech].mean() / max(rush[speech].mean(), 1e-6)),
        loudness=correlation(mouth[speech], loudness[speech]),
        sharpness=float(np.sqrt(np.median(series.sharpness[seen]))),
        restless=float(moving.mean()) if len(moving) >= MIN_SILENCE * rate else None,
    )
