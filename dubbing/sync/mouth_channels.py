"""What the members of the network look at: lip geometry, and the pixels of the mouth.

Both are taken as differences from their own mean over some seconds, so neither the person nor
the light nor a slow change of pose matters.

Letters: F frames, M mouth points, R rows and C columns of a crop, S = 2 M + R C values a frame.
"""

import numpy as np

from dubbing.face.mouth_crop import COLUMNS, ROWS
from dubbing.face.mouth_shape import MOUTH

# Where each kind of sight stands among the values of a frame. A member looks at one of them.
SIGHTS = {
    "lips": slice(0, 2 * len(MOUTH)),
    "pixels": slice(2 * len(MOUTH), 2 * len(MOUTH) + ROWS * COLUMNS),
}
# A mouth is compared with its own mean over this long before and after.
MEAN_SECONDS = 4.0
# What is added to grey values 0..255 before their logarithm: noise in the dark must not count.
DARK = 16.0


def running_mean(flat: np.ndarray, times: np.ndarray, reach: float) -> np.ndarray:
    """Mean of rows (F, X) within +-`reach` seconds of `times` (F,), rows with NaN left out.

    It does not depend on how a long video is cut into blocks. 0 where nothing was seen.
    """
    seen = np.isfinite(flat).all(1)
    running = np.zeros((len(flat) + 1, flat.shape[1]))
    running[1:] = np.cumsum(np.where(seen[:, None], flat, 0), axis=0)
    count = np.concatenate([[0], np.cumsum(seen)])
    low = np.searchsorted(times, times - reach)
    high = np.searchsorted(times, times + reach, side="right")
    mean = (running[high] - running[low]) / np.maximum(count[high] - count[low], 1)[:, None]
    return mean.astype(np.float32)


def centred(shapes: np.ndarray, times: np.ndarray, reach: float = MEAN_SECONDS) -> np.ndarray:
    """Mouth shapes (F, M, 2) less their running mean, (F, 2 M) float32; NaN stays."""
    flat = shapes.reshape(len(shapes), -1)
    return (flat - running_mean(flat, times, reach)).astype(np.float32)


def relative(crops: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Logarithm of crops (F, R, C) of grey values over their running mean, (F, R C) float32.

    Light and skin are factors of what a pixel shows, and fall out.
    """
    flat = crops.reshape(len(crops), -1).astype(np.float32)
    return np.log(flat + DARK) - np.log(running_mean(flat, times, MEAN_SECONDS) + DARK)


def look(shapes: np.ndarray, crops: np.ndarray, times: np.ndarray) -> np.ndarray:
    """All that a network of several members looks at, (F, S) float32; NaN without a face.

    Args:
        shapes: (F, M, 2) of `mouth_shape`, NaN where there is no face.
        crops: (F, R, C) uint8 of `mouth_crop`, anything where there is none.
        times: seconds, (F,).
    """
    there = np.isfinite(shapes).all((1, 2))
    pixels = np.full((len(crops), ROWS * COLUMNS), np.nan, np.float32)
    pixels[there] = relative(crops[there], times[there])
    return np.concatenate([centred(shapes, times), pixels], axis=1)
