import numpy as np
import pytest

from dubbing.provenance.card import GROUND, default_text, draw, undrawable


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1080, 1920), (128, 96), (64, 64)])
def test_the_text_is_whole_and_in_the_middle(width: int, height: int) -> None:
    card = draw(default_text(["Ann Smith", "Ben Jones", "Ann Smith"]), width, height)
    assert card.shape == (height, width, 3)
    rows, columns = np.nonzero(card[..., 0] > GROUND)
    assert rows.min() > 0
    assert rows.max() < height - 1
    assert columns.min() > 0.05 * width
    assert columns.max() < 0.95 * width
    assert abs((columns.min() + columns.max()) / 2 - width / 2) < 0.06 * width


def test_letters_are_as_large_as_there_is_room_for() -> None:
    few, many = draw("Thanks", 640, 360), draw("Thanks " * 60, 640, 360)
    assert np.ptp(np.nonzero(few[..., 0] > GROUND)[0]) < 360 * 0.1
    assert np.ptp(np.nonzero(many[..., 0] > GROUND)[0]) > 360 * 0.5


def test_who_agreed_is_named_once() -> None:
    assert default_text(["Ann", "Ben", "Ann"]).endswith("consent of Ann; Ben")


def test_letters_that_cannot_be_drawn() -> None:
    assert undrawable("") == undrawable("Zo\u00eb \u0411\u043e\u0440\u0438\u0441\n\u0391") == ""
    assert undrawable("a\u65e5b\u65e5\u05d0\t") == "\u65e5\u05d0\t"
