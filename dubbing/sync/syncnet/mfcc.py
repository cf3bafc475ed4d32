"""Mel-frequency cepstra with the settings SyncNet was trained on.

The definition is that of python_speech_features' defaults, written from its documentation: 25 ms
windows every 10 ms, no taper, pre-emphasis 0.97, FFT of 512, 26 mel filters from 0 to half the
sampling rate, logarithm, orthonormal DCT-II, sinusoidal lifter of 22, first coefficient replaced
by the logarithm of the energy.

Letters: N samples at 16 kHz, W windows, C = 13 coefficients.
"""

import numpy as np
from scipy.fft import dct

SAMPLE_RATE = 16_000
WINDOW = 400
HOP = 160
FFT = 512
FILTERS = 26
COEFFICIENTS = 13
PRE_EMPHASIS = 0.97
LIFTER = 22
# The logarithm of zero is that of the smallest step of a double.
_TINY = np.finfo(np.float64).eps


def _filters() -> np.ndarray:
    """Triangles between FFT bins on the mel scale 2595 log10(1 + f / 700), (26, 257)."""
    top = 2595 * np.log10(1 + SAMPLE_RATE / 2 / 700)
    hertz = 700 * (10 ** (np.linspace(0, top, FILTERS + 2) / 2595) - 1)
    edges = np.floor((FFT + 1) * hertz / SAMPLE_RATE)
    low, mid, high = edges[:-2, None], edges[1:-1, None], edges[2:, None]
    bins = np.arange(FFT // 2 + 1)
    rising = np.where((bins >= low) & (bins < mid), (bins - low) / (mid - low), 0)
    falling = np.where((bins >= mid) & (bins < high), (high - bins) / (high - mid), 0)
    return rising + falling


def mfcc(samples: np.ndarray) -> np.ndarray:
    """Cepstra (W, C) float64 of `samples` (N,) in the range of 16-bit integers.

    W = 1 + ceil((N - 400) / 160), at least 1; the last window is filled up with zeros.
    """
    signal = samples.astype(np.float64)
    emphasised = np.append(signal[:1], signal[1:] - PRE_EMPHASIS * signal[:-1])
    count = 1 + max(0, -(-(len(signal) - WINDOW) // HOP))
    padded = np.zeros((count - 1) * HOP + WINDOW)
    padded[: min(len(padded), len(emphasised))] = emphasised[: len(padded)]
    windows = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)[::HOP]
    power = np.abs(np.fft.rfft(windows, FFT)) ** 2 / FFT
    energy = power.sum(1)
    bands = power @ _filters().T
    bands, energy = (np.where(x == 0, _TINY, x) for x in (bands, energy))
    cepstra = dct(np.log(bands), type=2, axis=1, norm="ortho")[:, :COEFFICIENTS]
    cepstra *= 1 + LIFTER / 2 * np.sin(np.pi * np.arange(COEFFICIENTS) / LIFTER)
    cepstra[:, 0] = np.log(energy)
    return cepstra
