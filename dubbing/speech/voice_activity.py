"""Voice activity of audio, in steps of 20 ms.

Letters: N samples at 16 kHz, T steps of 20 ms (50 a second). Step t covers the samples
[320 t, 320 (t + 1)); a last step that is not full is padded with silence.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import chain

import numpy as np

SAMPLE_RATE = 16_000
STEP_RATE = 50
HOP = SAMPLE_RATE // STEP_RATE
if HOP * STEP_RATE != SAMPLE_RATE:
    raise ValueError("a step must be a whole number of samples")

# Steps processed at once: bounds the memory, and makes the result independent of the caller's
# blocks. They are a whole number of the detector's chunks.
BLOCK_STEPS = 2048
# The loud parts of a sound are assumed to be speech; this share of all steps is louder.
LOUD_SHARE = 0.03
# Detection runs at this level (rms of a full-scale square wave is 0 dB), so quiet sounds count.
TARGET_DB = -20.0
# A sound below this level is silent.
SILENCE_DB = -75.0
# Steps this far below the loud parts are not speech, whatever the detector reports.
RANGE_DB = 32.0
# Steps whose probability of speech is at most this are not speech.
LEAST_CHANCE = 0.3
_SMOOTHING = np.array([1, 2, 3, 2, 1], np.float32) / 9

Blocks = Callable[[], Iterable[np.ndarray]]


def steps(samples: int) -> int:
    """Number of 20 ms steps that hold `samples` samples."""
    return -(-samples // HOP)


def overlapping(
    blocks: Iterable[np.ndarray],
    step: int,
    piece: int,
    around: int = 0,
    *,
    before: int = 0,
    after: int = 0,
) -> Iterator[tuple[np.ndarray, int]]:
    """Pieces of a sound with what is around them: float32 samples, and the first step of the piece.

    The pieces do not depend on how the sound was split into blocks. Silence pads both ends.

    Args:
        step: samples of a step. piece: steps of a piece; the last one has the rest.
        around: steps of context on each side, as far as there are any.
        before, after: samples that the first and the last of these steps need beside their own.
    """
    held = np.zeros(before, np.float32)
    first = begin = total = 0  # the first step held, the first of the next piece, samples
    stop: int | None = None  # number of all steps, known at the end
    for block in chain(blocks, (None,)):
        if block is None:
            stop = -(-total // step)
            held = np.pad(held, (0, stop * step - total + after))
        else:
            total += len(block)
            held = np.concatenate([held, np.asarray(block, np.float32)])
        while True:
            size = (begin - first + piece + around) * step + before + after
            if len(held) < size if stop is None else begin >= stop:
                break
            yield held[:size], begin - first
            begin += piece
            dropped = max(0, begin - around) - first
            held, first = held[dropped * step :], first + dropped


def step_windows(blocks: Iterable[np.ndarray], width: int = HOP) -> Iterator[np.ndarray]:
    """Windows of `width` samples centred on the middle of every step, (<= BLOCK_STEPS, width).

    Silence pads both ends. The stacks do not depend on how the sound was split into blocks.

    Raises:
        ValueError: `width` is below a step or of the other parity.
    """
    margin = (width - HOP) // 2
    if margin < 0 or HOP + 2 * margin != width:
        raise ValueError(f"a window of {width} samples cannot be centred on a step of {HOP}")
    for samples, _ in overlapping(blocks, HOP, BLOCK_STEPS, before=margin, after=margin):
        yield np.lib.stride_tricks.sliding_window_view(samples, width)[::HOP]


def energy_db(blocks: Iterable[np.ndarray]) -> np.ndarray:
    """Mean power of every step in dB of full scale, (T,) float32, at least -120."""
    power = [np.mean(w.astype(np.float64) ** 2, axis=1) for w in step_windows(blocks)]
    joined = np.concatenate(power) if power else np.zeros(0)
    return (10 * np.log10(np.maximum(joined, 1e-12))).astype(np.float32)


def loudness_db(energy: np.ndarray) -> float:
    """Level of the loud steps of `energy` (T,), dB; -120 without any."""
    return float(np.quantile(energy, 1 - LOUD_SHARE)) if len(energy) else -120.0


def voice_activity_of_blocks(blocks: Blocks) -> np.ndarray:
    """`voice_activity` of a long sound that `blocks()` gives block by block (called twice)."""
    from dubbing.speech import voice_detector  # loads torch, which reading a manifest does not

    energy = energy_db(blocks())
    level = loudness_db(energy)
    if level < SILENCE_DB:
        return np.zeros(len(energy), np.float32)
    gain = 10 ** ((TARGET_DB - level) / 20)
    chances = voice_detector.probabilities(
        windows.ravel() * np.float32(gain) for windows in step_windows(blocks())
    )
    # Positions of the middles of the steps among those of the chunks.
    middles = (np.arange(len(energy)) + 0.5) * HOP / voice_detector.CHUNK - 0.5
    chance = np.interp(middles, np.arange(len(chances)), chances)
    voiced = (chance > LEAST_CHANCE).astype(np.float32)
    voiced[energy < level - RANGE_DB] = 0
    return np.convolve(voiced, _SMOOTHING, mode="same")[: len(voiced)].astype(np.float32)


def voice_activity(samples: np.ndarray) -> np.ndarray:
    """Share of speech in every 20 ms step.

    Args:
        samples: sound at 16 kHz, (N,), -1..1; its level does not matter.

    Returns:
        (T,) float32 in 0..1: 0 in silence, 1 well inside speech, smoothed over five steps.
    """
    return voice_activity_of_blocks(lambda: [samples])


def at_times(series: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Linear interpolation of `series` (T, ...) of 50 values a second at `times` (seconds).

    Step t is at (t + 0.5) / 50 s; zeros pad both ends.
    """
    count = len(series)
    place = np.asarray(times, np.float64) * STEP_RATE - 0.5
    # A zero on each side, so that the ends fade instead of jumping.
    padded = np.zeros((count + 2, *series.shape[1:]), np.float32)
    padded[1:-1] = series
    place = np.clip(place + 1, 0, count + 1)
    low = np.minimum(np.floor(place).astype(np.int64), count)
    weight = (place - low).astype(np.float32).reshape(place.shape + (1,) * (series.ndim - 1))
    return padded[low] * (1 - weight) + padded[low + 1] * weight
