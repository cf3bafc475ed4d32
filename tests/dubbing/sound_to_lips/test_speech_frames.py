"""The speech of a frame is the sound in its middle, to the sample."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.sound_to_lips.speech_frames import SpeechFrames, at_moments
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


def test_a_part_is_that_part_and_both_are_of_one_length() -> None:
    heard = at_moments(clock(3), clock(NUMBERS), (np.arange(20) + 0.5) / 25)
    np.testing.assert_array_equal(heard.part(3, 9).lips, heard.lips[3:9])
    np.testing.assert_array_equal(heard.part(3, 9).windows, heard.windows[3:9])
    with pytest.raises(ValueError, match="19 frames of speech, 20 of lips"):
        SpeechFrames(heard.windows[:19], heard.lips)
