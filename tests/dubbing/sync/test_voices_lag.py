"""How late voices are heard in a mix."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dubbing.sync.voices_lag import voices_lag

RATE = 16_000
Write = Callable[[np.ndarray], Path]


def noise(seed: int, smooth: int = 4) -> np.ndarray:
    """Four seconds of noise at -20 dB, the higher the quieter."""
    made = np.random.default_rng(seed).normal(size=4 * RATE)
    made = np.convolve(made, np.ones(smooth), mode="same")
    return np.asarray(0.1 * made / made.std())


def bursts(seed: int) -> np.ndarray:
    """Syllables of noise, four a second."""
    return noise(seed) * (np.sin(np.arange(4 * RATE) * 2 * np.pi * 4 / RATE) > 0)


@pytest.mark.parametrize("samples", [0, 1920, -640])
def test_the_lag_under_a_bed_that_is_louder(
    tmp_path: Path, sound_file: Write, samples: int
) -> None:
    voices = bursts(0)
    stem = sound_file(voices).rename(tmp_path / "stem.wav")
    mixed = sound_file(0.3 * np.roll(voices, samples) + noise(1, smooth=40))
    assert voices_lag(mixed, stem) == samples / RATE


def test_other_voices_are_not_heard(tmp_path: Path, sound_file: Write) -> None:
    stem = sound_file(bursts(0)).rename(tmp_path / "stem.wav")
    assert voices_lag(sound_file(bursts(1)), stem) is None
    assert voices_lag(sound_file(0 * bursts(1)), stem) is None
