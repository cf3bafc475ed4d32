"""Cepstra beside a slow loop."""

import numpy as np
import pytest

from dubbing.workshop.lab.syncnet.mfcc import mfcc

pytestmark = pytest.mark.medium


def slow_mfcc(samples: np.ndarray) -> np.ndarray:
    """The documented definition, a window and a filter at a time."""
    signal = [float(s) for s in samples]
    signal = [signal[0]] + [signal[i] - 0.97 * signal[i - 1] for i in range(1, len(signal))]
    edges = []
    for i in range(28):
        mel = 2595 * np.log10(1 + 8000 / 700) * i / 27
        edges.append(int(np.floor(513 * 700 * (10 ** (mel / 2595) - 1) / 16000)))
    rows = []
    start = 0
    while True:
        window = np.zeros(512)
        piece = signal[start : start + 400]
        window[: len(piece)] = piece
        power = np.abs(np.fft.rfft(window)) ** 2 / 512
        bands = np.zeros(26)
        for j in range(26):
            for i in range(edges[j], edges[j + 1]):
                bands[j] += power[i] * (i - edges[j]) / (edges[j + 1] - edges[j])
            for i in range(edges[j + 1], edges[j + 2]):
                bands[j] += power[i] * (edges[j + 2] - i) / (edges[j + 2] - edges[j + 1])
        row = []
        for k in range(13):
            angle = np.pi * k * (2 * np.arange(26) + 1) / 52
            value = np.sqrt((1 if k == 0 else 2) / 26) * (np.log(bands) * np.cos(angle)).sum()
            row.append(value * (1 + 11 * np.sin(np.pi * k / 22)))
        row[0] = np.log(power.sum())
        rows.append(row)
        if start + 400 >= len(signal):
            return np.array(rows)
        start += 160


@pytest.mark.parametrize("count", [100, 400, 401, 2000])
def test_against_a_slow_loop(count: int) -> None:
    samples = np.round(3000 * np.random.default_rng(0).normal(size=count))
    assert np.allclose(mfcc(samples), slow_mfcc(samples), atol=1e-9)


def test_silence_is_finite() -> None:
    assert np.isfinite(mfcc(np.zeros(1000))).all()
