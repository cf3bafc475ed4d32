"""Mel-frequency cepstra with the settings SyncNet was trained on; see `speech.deepspeech.cepstra`.

Letters: N samples at 16 kHz, W windows, C = 13 coefficients.
"""

import numpy as np

from dubbing.speech.deepspeech.cepstra import EMPHASIS, SAMPLE_RATE, cepstra
from dubbing.speech.deepspeech.cepstra import WIDTH as WINDOW

__all__ = ["HOP", "SAMPLE_RATE", "WINDOW", "mfcc"]

HOP = 160
COEFFICIENTS = 13


def mfcc(samples: np.ndarray) -> np.ndarray:
    """Cepstra (W, C) float64 of `samples` (N,) in the range of 16-bit integers.

    W = 1 + ceil((N - 400) / 160), at least 1; the last window is filled up with zeros.
    """
    signal = samples.astype(np.float64)
    emphasised = np.append(signal[:1], signal[1:] - EMPHASIS * signal[:-1])
    count = 1 + max(0, -(-(len(signal) - WINDOW) // HOP))
    padded = np.zeros((count - 1) * HOP + WINDOW)
    padded[: min(len(padded), len(emphasised))] = emphasised[: len(padded)]
    windows = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP]
    return cepstra(windows)[:, :COEFFICIENTS]
