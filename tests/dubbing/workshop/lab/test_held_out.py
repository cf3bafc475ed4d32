"""Which frames of a clip are tested."""

from fractions import Fraction

import pytest

from dubbing.workshop.lab.held_out import held_out, unlearned

pytestmark = pytest.mark.medium


RATE = Fraction(25)
FRAMES, LEARNED = 12, [(2, 5)]
PARTS = [(7, 5), (0, 2)]


@pytest.mark.parametrize(
    ("seconds", "learned", "most", "expected"),
    [
        (20, 15, None, (375, 125)),
        (40, 15, None, (750, 250)),
        (18, 15, None, (375, 75)),
        (20, 15, 2.0, (375, 50)),
        (20, 15, 60.0, (375, 125)),
    ],
)
def test_the_end_of_a_clip_is_held_out(
    seconds: int, learned: float, most: float | None, expected: tuple[int, int]
) -> None:
    first = round(25 * learned)
    parts = [(first, 25 * seconds - first)]
    assert held_out(25 * seconds, RATE, parts, most) == expected


def test_between_learned_parts_the_last_that_is_long_enough_is_held_out() -> None:
    parts = [(700, 50), (400, 200), (100, 130)]
    assert held_out(750, RATE, parts) == (475, 125)
    assert held_out(750, RATE, [(700, 50), (100, 60)]) == (100, 60)


def test_all_that_was_not_learned_is_spoken() -> None:
    assert unlearned(FRAMES, RATE, LEARNED) == PARTS
    assert unlearned(FRAMES, RATE, LEARNED, most=6 / 25) == [(7, 5), (0, 1)]
    assert unlearned(FRAMES, RATE, LEARNED, most=3 / 25) == [(7, 3)]
    assert unlearned(FRAMES, RATE, [(1, 2), (6, 3)]) == [(9, 3), (3, 3), (0, 1)]
    assert unlearned(FRAMES, RATE, [(0, 5)]) == [(5, 7)]
    assert unlearned(FRAMES, RATE, [(4, 100)]) == [(0, 4)]
    assert unlearned(FRAMES, RATE, [(0, 100)]) == []
