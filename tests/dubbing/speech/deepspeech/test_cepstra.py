"""The cepstra beside a literal reading of their definition, one window at a time."""

import math
from itertools import pairwise

import numpy as np
import pytest

from dubbing.speech.deepspeech import cepstra as front

SOUND = (np.random.default_rng(0).normal(size=2000) * 0.1).astype(np.float32)


def literal(sound: np.ndarray) -> np.ndarray:
    """25 ms every 10 ms, 26 of 26 cepstra, lifter 22, energy in place of the first."""
    whole = [float(v) for v in np.round(sound.astype(np.float64) * 32768)]
    emphasised = [whole[0]] + [b - 0.97 * a for a, b in pairwise(whole)]
    count = 1 + math.ceil((len(whole) - 400) / 160) if len(whole) > 400 else 1
    emphasised += [0.0] * ((count - 1) * 160 + 400 - len(emphasised))
    mels = [2595 * math.log10(1 + 8000 / 700) * k / 27 for k in range(28)]
    bins = [math.floor(513 * 700 * (10 ** (mel / 2595) - 1) / 16000) for mel in mels]
    rows = []
    for k in range(count):
        power = np.abs(np.fft.fft(emphasised[160 * k : 160 * k + 400], 512)[:257]) ** 2 / 512
        bands = []
        for low, middle, high in zip(bins, bins[1:], bins[2:], strict=False):
            rising = sum(power[i] * (i - low) / (middle - low) for i in range(low, middle))
            falling = sum(power[i] * (high - i) / (high - middle) for i in range(middle, high))
            bands.append(math.log(rising + falling))
        row = []
        for n in range(26):
            wave = sum(b * math.cos(math.pi * n * (2 * m + 1) / 52) for m, b in enumerate(bands))
            scale = math.sqrt((1 if n == 0 else 2) / 26)
            row.append(wave * scale * (1 + 11 * math.sin(math.pi * n / 22)))
        row[0] = math.log(power.sum())
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("samples", [100, 400, 401, 960, 1999])
def test_cepstra_are_what_their_definition_gives(samples: int) -> None:
    expected = literal(SOUND[:samples])[::2]
    count = front.steps_heard(samples)
    assert count == len(expected)
    whole = np.concatenate(list(front.emphasised([SOUND[:77], SOUND[77:samples]])))
    padded = np.pad(whole, (0, 800))
    windows = np.stack([padded[320 * k : 320 * k + 400] for k in range(count)])
    assert np.allclose(front.cepstra(windows), expected, rtol=1e-9, atol=1e-8)


def test_inputs_hold_nine_steps_on_each_side_and_zeros_beyond_the_ends() -> None:
    found = np.random.default_rng(1).normal(size=(30, 26)) + 3
    inputs = front.inputs(found, 0, 30)
    assert inputs.shape == (30, 494)
    for step in (0, 12, 29):
        for k in range(19):
            there = 0 <= step + k - 9 < 30
            expected = found[step + k - 9] if there else np.zeros(26)
            assert np.array_equal(inputs[step, 26 * k : 26 * k + 26], expected)
    assert np.array_equal(front.inputs(found, 4, 20), inputs[4:20])
    assert front.level(found) == pytest.approx((inputs.mean(), inputs.std()))


def test_digital_silence_is_a_number() -> None:
    assert np.isfinite(front.cepstra(np.zeros((3, 400)))).all()
    assert front.level(np.zeros((3, 26)))[1] > 0
