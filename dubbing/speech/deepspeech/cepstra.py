"""The input of DeepSpeech: mel-frequency cepstra with their neighbours.

The definition is that of python_speech_features' defaults, written from its documentation: 25 ms
windows every 10 ms, no taper, pre-emphasis 0.97, FFT of 512, 26 mel filters from 0 to half the
sampling rate, logarithm, orthonormal DCT-II, sinusoidal lifter of 22, first coefficient replaced by
the logarithm of the energy.

Letters: T steps of 20 ms, W = 400 samples (25 ms), C = 26 cepstra, K = 9 steps on each side.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.fft import dct

SAMPLE_RATE = 16_000
WIDTH, CEPSTRA, CONTEXT = 400, 26, 9
INPUTS = (2 * CONTEXT + 1) * CEPSTRA
FFT = 512
EMPHASIS = 0.97
LIFTER = 22
FULL_SCALE = 32768  # it was trained on 16-bit integers
_LEAST = np.finfo(np.float64).eps


def emphasised(blocks: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Each sample minus .97 of the one before; samples of -1..1 become 16-bit integers first."""
    before = np.zeros(1)
    for block in blocks:
        level = np.round(np.asarray(block, np.float64) * FULL_SCALE)
        x = np.concatenate([before, level.clip(-FULL_SCALE, FULL_SCALE - 1)])
        before = x[-1:]
        yield x[1:] - EMPHASIS * x[:-1]


def mel_bank() -> np.ndarray:
    """Triangular filters between points that are even on the mel scale, (26, 257).

    Mel is 2595 log10(1 + f / 700). Points are rounded down to bins of the spectrum.
    """
    mel = np.linspace(0, 2595 * np.log10(1 + SAMPLE_RATE / 2 / 700), CEPSTRA + 2)
    points = np.floor((FFT + 1) * 700 * (10 ** (mel / 2595) - 1) / SAMPLE_RATE)
    low, middle, high = points[:-2, None], points[1:-1, None], points[2:, None]
    bins = np.arange(FFT // 2 + 1)
    return np.minimum((bins - low) / (middle - low), (high - bins) / (high - middle)).clip(0)


def cepstra(windows: np.ndarray) -> np.ndarray:
    """Cepstra (T, C) of emphasised windows (T, W); the first one is the logarithm of the energy."""
    power = np.abs(np.fft.rfft(windows, FFT)) ** 2 / FFT
    rows = dct(_log(power @ mel_bank().T), norm="ortho", axis=1)
    rows *= 1 + LIFTER / 2 * np.sin(np.pi * np.arange(CEPSTRA) / LIFTER)
    rows[:, 0] = _log(power.sum(1))
    return rows


def _log(x: np.ndarray) -> np.ndarray:
    """The logarithm; that of zero is that of the smallest step of a double."""
    return np.log(np.where(x == 0, _LEAST, x))


def steps_heard(samples: int) -> int:
    """T of a sound: windows start every 10 ms until one reaches its end; every second counts."""
    windows = 1 + max(0, -(-(samples - WIDTH) // (SAMPLE_RATE // 100)))
    return -(-windows // 2)


def level(rows: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation of all inputs made from cepstra (T, C), T > 0.

    A step is in the inputs of up to 19 steps; zeros pad both ends.
    """
    count = len(rows)
    place = np.arange(count)
    times = np.minimum(place + CONTEXT, count - 1) - np.maximum(place - CONTEXT, 0) + 1
    total = count * INPUTS
    mean = float((times * rows.sum(1)).sum() / total)
    square = float((times * (rows**2).sum(1)).sum() / total)
    return mean, max(square - mean**2, _LEAST) ** 0.5


def inputs(rows: np.ndarray, first: int, last: int) -> np.ndarray:
    """Cepstra of steps `first` to `last` with those of their neighbours, (last - first, 494)."""
    padded = np.pad(rows, ((CONTEXT, CONTEXT), (0, 0)))[first : last + 2 * CONTEXT]
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * CONTEXT + 1, axis=0)
    return np.ascontiguousarray(windows.transpose(0, 2, 1)).reshape(last - first, INPUTS)
