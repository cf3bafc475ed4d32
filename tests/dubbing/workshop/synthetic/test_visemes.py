"""The mouth follows the phones: closures close, vowels open, and the mouth leads a little."""

from fractions import Fraction

import numpy as np
import pytest

from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.visemes import CHANNELS, Phone, mouth_curves

pytestmark = pytest.mark.medium


RATE = Fraction(25)
JAW, PRESS, TUCK = (CHANNELS.index(name) for name in ("jaw", "press", "tuck"))


def test_channels_are_the_fields_of_the_mouth() -> None:
    assert tuple(MouthShape.__dataclass_fields__) == CHANNELS


@pytest.mark.parametrize("closed", ["p", "b", "m"])
def test_a_short_closure_between_vowels_closes(closed: str) -> None:
    phones = [Phone("a", 0.0, 0.5), Phone(closed, 0.5, 0.55), Phone("a", 0.55, 1.0)]
    curves = mouth_curves(phones, 25, RATE)
    assert curves[5, JAW] > 0.9
    assert curves[18, JAW] > 0.9
    frame = int(np.argmax(curves[:, PRESS]))
    assert abs((frame + 0.5) / 25 - 0.5) < 0.06
    assert curves[frame, PRESS] > 0.8
    assert curves[frame, JAW] < 0.1


def test_f_puts_the_lip_under_the_teeth() -> None:
    curves = mouth_curves([Phone("o", 0, 0.4), Phone("f", 0.4, 0.5), Phone("o", 0.5, 1)], 25, RATE)
    assert curves[:, TUCK].max() > 0.8
    assert curves[:6, TUCK].max() < 0.01


def test_diphthongs_pass_through_both_vowels() -> None:
    curves = mouth_curves([Phone("", 0, 0.4), Phone("aɪ", 0.4, 0.8), Phone("", 0.8, 1)], 25, RATE)
    assert int(np.argmax(curves[:, JAW])) < int(np.argmax(curves[:, CHANNELS.index("wide")]))


def test_silence_is_rest() -> None:
    np.testing.assert_allclose(mouth_curves([Phone("", 0.0, 1.0)], 25, RATE), 0.0)
