"""Channels, the inputs of the sync network: of the mouth, and of the sound.

Lip geometry and pixels of the mouth are differences from their own mean over some seconds, so
neither the person nor the light nor a slow change of pose matters. The sound is log-mel, and
features of a recurrent network.

Letters: F frames, M mouth points, R rows and C columns of a crop, S = 2 M + R C values a frame;
N samples at 16 kHz, T steps of 20 ms, D = 144 channels.
"""

import numpy as np

from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS
from dubbing.face.mouth.mouth_shape import MOUTH
from dubbing.speech.mel_features import MelFeatures
from dubbing.speech.rnn_features import RnnFeatures

# Position of each kind of channel among the values of a frame. A member takes one of them.
MOUTH_CHANNELS = {
    "lips": slice(0, 2 * len(MOUTH)),
    "pixels": slice(2 * len(MOUTH), 2 * len(MOUTH) + ROWS * COLUMNS),
}
# A mouth is compared with its own mean over this long before and after.
MEAN_SECONDS = 4.0
# Added to grey values 0..255 before their logarithm: noise in the dark must not count.
DARK = 16.0
# The same of the sound.
SOUND_CHANNELS = {"mel": slice(0, 80), "rnn": slice(80, 144)}
WIDTH = 144


def running_mean(flat: np.ndarray, times: np.ndarray, seconds: float) -> np.ndarray:
    """Mean of rows (F, X) within +-`seconds` of `times` (F,), without rows of NaN.

    It does not depend on how a long video is split into blocks. 0 without any valid row.
    """
    valid = np.isfinite(flat).all(1)
    running = np.zeros((len(flat) + 1, flat.shape[1]))
    running[1:] = np.cumsum(np.where(valid[:, None], flat, 0), axis=0)
    count = np.concatenate([[0], np.cumsum(valid)])
    low = np.searchsorted(times, times - seconds)
    high = np.searchsorted(times, times + seconds, side="right")
    mean = (running[high] - running[low]) / np.maximum(count[high] - count[low], 1)[:, None]
    return mean.astype(np.float32)


def centred(shapes: np.ndarray, times: np.ndarray, seconds: float = MEAN_SECONDS) -> np.ndarray:
    """Mouth shapes (F, M, 2) minus their running mean, (F, 2 M) float32; NaN stays."""
    flat = shapes.reshape(len(shapes), -1)
    return (flat - running_mean(flat, times, seconds)).astype(np.float32)


def relative(crops: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Logarithm of crops (F, R, C) of grey values over their running mean, (F, R C) float32.

    Light and skin are factors of a pixel's value, and cancel.
    """
    flat = crops.reshape(len(crops), -1).astype(np.float32)
    return np.log(flat + DARK) - np.log(running_mean(flat, times, MEAN_SECONDS) + DARK)


def mouth_channels(shapes: np.ndarray, crops: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Mouth channels of all members, (F, S) float32; NaN without a face.

    Args:
        shapes: (F, M, 2) of `mouth_shape`, NaN without a face.
        crops: (F, R, C) uint8 of `mouth_crop`, arbitrary without a face.
        times: seconds, (F,).
    """
    valid = np.isfinite(shapes).all((1, 2))
    pixels = np.full((len(crops), ROWS * COLUMNS), np.nan, np.float32)
    pixels[valid] = relative(crops[valid], times[valid])
    return np.concatenate([centred(shapes, times), pixels], axis=1)


class SoundChannels:
    """Extracts the channels of sounds. Loads the acoustic network once."""

    def __init__(self) -> None:
        self._parts = (MelFeatures(), RnnFeatures())

    def extract(self, samples: np.ndarray) -> np.ndarray:
        """Channels (T, D) float32 of samples (N,)."""
        return np.concatenate([part.extract(samples) for part in self._parts], axis=1)
