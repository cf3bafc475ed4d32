"""The speech of a frame is the sound in its middle, to the sample."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from dfrf.field.speaker_adaptation import NUMBERS, PREDICTED
from dubbing.sound_to_lips.speech_frames import ROUND_S, SpeechFrames, at_moments, styled
from dubbing.speech.features import WINDOW

STEPS = 100  # two seconds


def clock(width: int) -> np.ndarray:
    """Series (STEPS, width) that says at every moment which second it is."""
    return np.repeat((np.arange(STEPS, dtype=np.float32) + 0.5)[:, None] / 50, width, 1)


@pytest.mark.parametrize("rate", [Fraction(24000, 1001), Fraction(25), Fraction(60)])
@pytest.mark.parametrize("first", [0, 7, 2.25, -0.4])
def test_a_frame_hears_its_own_middle(rate: Fraction, first: float) -> None:
    middle = (first + np.arange(20) + 0.5) / float(rate)
    heard = at_moments(clock(3), clock(NUMBERS), middle)
    shown = np.repeat(middle[:, None], NUMBERS, 1)
    np.testing.assert_allclose(heard.lips, shown.clip(0.5 / 50), atol=1e-5)
    # The window lies round the middle as well: its values are 20 ms apart, half of them before it.
    around = middle[:, None] + (np.arange(WINDOW) - 7.5) / 50
    inside = around > 0.5 / 50
    np.testing.assert_allclose(heard.windows[..., 0][inside], around[inside], atol=1e-5)


def test_lips_stay_as_they_are_before_and_after_the_sound_which_is_silent() -> None:
    heard = at_moments(clock(3), clock(NUMBERS), (np.arange(-5, 55) + 0.5) / 25)
    np.testing.assert_allclose(heard.lips[:5], 0.5 / 50)
    np.testing.assert_allclose(heard.lips[-4:], (STEPS - 0.5) / 50)
    assert not heard.windows[-1].any()


def test_windows_and_lips_are_of_one_length() -> None:
    heard = at_moments(clock(3), clock(NUMBERS), (np.arange(20) + 0.5) / 25)
    with pytest.raises(ValueError, match="19 frames of speech, 20 of lips"):
        SpeechFrames(heard.windows[:19], heard.lips)


def test_a_style_brings_lips_nearer_to_their_mean_or_further_from_it() -> None:
    lips = np.random.default_rng(0).random((STEPS, NUMBERS)).astype(np.float32)
    assert styled(lips, "as spoken") is lips
    softer, clearer = (styled(lips, style) for style in ("softer", "clearer"))
    np.testing.assert_array_equal(softer[:, PREDICTED:], lips[:, PREDICTED:])  # what is heard
    np.testing.assert_allclose((softer + clearer) / 2, lips, atol=1e-6)
    np.testing.assert_allclose(styled(np.ones_like(lips), "softer"), 1, atol=1e-6)
    # An opening of one step opens less, and the mouth closes further beside one that is clearer.
    peak = np.zeros_like(lips)
    peak[50] = 1
    softer, clearer = (styled(peak, style)[:, 0] for style in ("softer", "clearer"))
    around = round(ROUND_S * 50)
    assert softer[50] == softer.max() == pytest.approx(1 / around)
    assert softer.sum() == pytest.approx(1)
    assert np.flatnonzero(softer)[[0, -1]].tolist() == [51 - around, 49 + around]
    assert clearer[50] > 1.8
    assert clearer.min() < -0.05
