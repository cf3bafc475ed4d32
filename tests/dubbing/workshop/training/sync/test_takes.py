"""Other takes of the same sound."""

import numpy as np
import pytest

from dubbing.speech.voice_activity import STEP_RATE
from dubbing.sync.network.channels import SOUND_CHANNELS, WIDTH, SoundChannels
from dubbing.workshop.training.sync.takes import Take, another_take, take_windows
from tests.dubbing.conftest import Speaker

pytestmark = pytest.mark.medium


CHANNELS = SoundChannels()


def test_another_take_sounds_the_same_at_its_own_speed(speaker: Speaker) -> None:
    """What is spoken at second t of the clip is heard at t / speed, in both kinds of channels."""
    clean = CHANNELS.extract(speaker.sound)
    for seed in (2, 3, 4):
        take = another_take(speaker.sound, CHANNELS, np.random.default_rng(seed))
        assert abs(take.speed - 1) > 0.01
        assert len(take.sound) == pytest.approx(len(clean) / take.speed, abs=2)
        places = np.arange(20, 160)
        for part in SOUND_CHANNELS.values():
            own = clean[places, part]
            right, wrong = (
                take.sound[np.round(places / take.speed + shift).astype(int), part]
                for shift in (0, 12)
            )
            assert alike(own, right) > 0.3
            assert alike(own, right) > 2 * alike(own, wrong)


def alike(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation of two pieces less their means over time."""
    a, b = a - a.mean(0), b - b.mean(0)
    return float((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))


@pytest.mark.parametrize("speed", [0.8, 1.25])
def test_a_take_is_read_at_its_speed(speed: float) -> None:
    """Every channel tells the second of the clip it belongs to."""
    steps = (np.arange(round(400 / speed)) + 0.5) / STEP_RATE * speed
    take = Take(speed, np.repeat(steps[:, None], WIDTH, 1).astype(np.float32))
    clean = Take(1.0, np.repeat(((np.arange(400) + 0.5) / STEP_RATE)[:, None], WIDTH, 1))
    moments = np.array([1.0, 2.345, 5.0])
    for tempo in (0.9, 1.1):
        read = take_windows(take, moments, tempo)
        assert np.allclose(read, take_windows(clean, moments, tempo), atol=1e-4)
        assert np.allclose(read.mean(1), moments[:, None], atol=1e-4)
