"""Phone classes: unambiguous, complete for what the synthesisers say, placed in time."""

import numpy as np
import pytest

from dubbing.speech.phone_classes import CLASSES, SILENCE
from dubbing.workshop.synthetic.visemes import Phone
from dubbing.workshop.training.speech import phones
from dubbing.workshop.training.speech.phones import ARPABET, UNKNOWN, classes_at_steps
from tests.dubbing.workshop.training.speech.made import spoken

pytestmark = pytest.mark.medium


def name(k: int) -> str:
    return CLASSES[k][:1]


def test_no_letter_is_in_two_classes() -> None:
    letters = "".join(CLASSES)
    assert len(letters) == len(set(letters))


def test_every_phone_of_flite_has_a_class() -> None:
    assert all(symbol == "" or phones.letters(symbol) for symbol in ARPABET.values())


def test_every_phone_of_a_sentence_has_a_class() -> None:
    message = spoken().phones
    assert message is not None
    assert all(phones.letters(p.symbol) for p in message if p.symbol)


def test_phones_stand_where_they_sound() -> None:
    message = [Phone("", 0, 0.1), Phone("aɪ", 0.1, 0.3), Phone("?", 0.3, 0.4)]
    found = classes_at_steps(message, 25)
    assert (found[:5] == SILENCE).all()
    assert [name(k) for k in found[5:15]] == ["a"] * 5 + ["i"] * 5
    assert (found[15:] == UNKNOWN).all()
    assert classes_at_steps([], 3).tolist() == [UNKNOWN] * 3
    assert classes_at_steps(message, 2).tolist() == [SILENCE] * 2
    assert found.dtype == np.int64
