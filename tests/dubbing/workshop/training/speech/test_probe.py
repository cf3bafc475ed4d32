"""The probe: finds a linear relation, does not find one that is not there, leaves people out."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d

from dubbing.workshop.training.speech import evaluation, probe
from dubbing.workshop.training.speech.probe import Speaker

pytestmark = pytest.mark.medium


def smooth(rng: np.random.Generator) -> np.ndarray:
    """Noise (700, 6) that changes within 0.2 s."""
    return uniform_filter1d(rng.normal(size=(700, 6)), 10, axis=0) * 3


def people(relation: bool) -> tuple[list[Speaker], list[np.ndarray]]:
    """Five people whose lips follow two of six features 80 ms later, or do not."""
    rng = np.random.default_rng(0)
    found, heard = [], []
    for k in range(5):
        features = smooth(rng)
        times = (np.arange(300) + 5.5) / 25
        source = features if relation else smooth(rng)
        # Step t stands at (t + 0.5) / 50 s.
        late = np.interp(times - 0.08, (np.arange(700) + 0.5) / 50, source[:, 0])
        wide = np.interp(times - 0.08, (np.arange(700) + 0.5) / 50, source[:, 3])
        lips = np.stack([late, -wide], 1)
        lips = (lips - lips.mean(0)) / lips.std(0)
        found.append(Speaker(f"p{k}", Path("none"), lips, times))
        heard.append(features.astype(np.float32))
    return found, heard


def test_a_relation_is_found_on_people_left_out() -> None:
    found = probe.fit(*people(relation=True))
    assert found.left_out.shape == (5, 2)
    assert found.left_out.min() > 0.95


def test_no_relation_is_none() -> None:
    assert np.abs(probe.fit(*people(relation=False)).left_out.mean(0)).max() < 0.3


def test_others_are_predicted_from_all() -> None:
    everyone, heard = people(relation=True)
    fitted = probe.fit(everyone[:4], heard[:4])
    assert probe.unseen(fitted, everyone[4:], heard[4:]).min() > 0.95


def test_pink_noise_falls_by_three_decibel_an_octave() -> None:
    noise = evaluation.pink_noise(160_000, np.random.default_rng(0))
    power = np.abs(np.fft.rfft(noise)) ** 2
    octaves = [power[a : 2 * a].mean() for a in (1000, 2000, 4000, 8000)]
    steps = np.diff(10 * np.log10(octaves))
    assert np.allclose(steps, -3, atol=0.5)
    assert np.isclose((noise**2).mean(), 1, atol=1e-3)


def test_noise_is_ten_decibel_below() -> None:
    sound = np.sin(np.arange(16_000) * 0.2).astype(np.float32)
    added = evaluation.noisy(sound) - sound
    assert np.isclose(10 * np.log10((sound**2).mean() / (added**2).mean()), 10, atol=0.1)
