"""Whether the mouth moves, and whether it rests in silence."""

import numpy as np
import pytest

from dubbing.face.mouth_shape import mouth_shape
from dubbing.sync.motion import MotionSum, silent_frames
from tests.dubbing.sync.meshes import canonical, talk

VOICE = np.repeat([1.0, 0.0], 100)
SYLLABLES = 0.06 + 0.05 * np.sin(2 * np.pi * 4 * np.arange(200) / 25)


def motion_of(opening: np.ndarray, voice: np.ndarray = VOICE) -> MotionSum:
    total = MotionSum(25.0)
    total.add(mouth_shape(talk(opening), canonical()), voice)
    return total


def test_a_mouth_that_rests_in_silence() -> None:
    found = motion_of(np.where(VOICE > 0, SYLLABLES, 0.01)).result()
    assert found.moves
    assert found.moves_in_silence is False
    assert found.opening_range == pytest.approx(0.08, abs=0.03)


def test_a_mouth_that_goes_on() -> None:
    found = motion_of(SYLLABLES).result()
    assert found.moves_in_silence is True
    assert found.speed_in_silence == pytest.approx(found.speed_in_speech, rel=0.1)


def test_a_still_mouth_with_noise() -> None:
    noise = np.random.default_rng(0).normal(0, 0.005, 200)
    found = motion_of(0.05 + noise).result()
    assert not found.moves


def test_too_little_silence_gives_no_figure() -> None:
    found = motion_of(SYLLABLES, np.ones(200)).result()
    assert found.moves_in_silence is None
    assert found.speed_in_silence is None


def test_unseen_frames_do_not_count() -> None:
    shapes = mouth_shape(talk(SYLLABLES), canonical())
    shapes[50:150] = np.nan
    total = MotionSum(25.0)
    total.add(shapes, VOICE)
    assert total.result().opening_range == pytest.approx(0.08, abs=0.03)
    nothing = MotionSum(25.0)
    nothing.add(np.full_like(shapes, np.nan), VOICE)
    assert not nothing.result().moves


def test_silence_has_a_margin() -> None:
    voice = np.zeros(50)
    voice[20:25] = 1
    silent = silent_frames(voice, 25.0)
    assert silent[:12].all()
    assert not silent[12:33].any()
    assert silent[33:].all()
