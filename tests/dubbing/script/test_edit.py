"""An edit from frame to frame: how strong the lips move, and which moment they speak."""

from fractions import Fraction

import numpy as np
import pytest

from dubbing.script.edit import AROUND, HELD, Edit

RATE = Fraction(100)  # a frame each 10 ms, whose middle counts


def test_without_keys_it_is_the_line_s() -> None:
    np.testing.assert_array_equal(Edit().strengths(5, RATE), np.ones(5))
    np.testing.assert_array_equal(Edit(strength=0.5).strengths(5, RATE), np.full(5, 0.5))


def test_a_key_holds_and_the_line_s_own_comes_back() -> None:
    found = Edit(strength=0.8, keys=((0.505, 0.0),)).strengths(100, RATE)
    held, around = round(100 * HELD), round(100 * AROUND)
    assert not found[50 - held : 51 + held].any()
    assert found[50 - around] == found[50 + around] == pytest.approx(0.8)
    np.testing.assert_allclose(np.diff(found[50 + held : 51 + around]), 0.1, atol=1e-6)
    np.testing.assert_allclose(np.delete(found, range(50 - around, 51 + around)), 0.8)


def test_between_keys_that_are_near_the_line_s_own_does_not_come_back() -> None:
    found = Edit(keys=((0.605, 1.4), (0.405, 0.0))).strengths(100, RATE)  # in any order
    assert found[40] == 0
    assert found[60] == pytest.approx(1.4)
    assert (np.diff(found[44:57]) > 0).all()
    assert found[52] == pytest.approx(1.4 * (52 - 44) / (56 - 44))
    # Further apart, it does.
    far = Edit(keys=((0.305, 0.0), (0.705, 0.0))).strengths(100, RATE)
    np.testing.assert_allclose(far[42:59], 1)


def test_a_key_at_the_beginning_is_not_cut_off() -> None:
    found = Edit(keys=((0.0, 0.0),)).strengths(30, RATE)
    assert found[0] == 0
    np.testing.assert_allclose(found[12:], 1)


def test_keys_are_moments_of_the_sound_which_a_shifted_mouth_follows() -> None:
    plain = Edit(keys=((0.505, 0.0),)).strengths(100, RATE)
    late = Edit(shift=80, keys=((0.505, 0.0),)).strengths(100, RATE)
    np.testing.assert_allclose(late[8:], plain[:-8])


def test_a_moved_part_is_spoken_later_and_the_rest_comes_back_into_step() -> None:
    plain = Edit().heard(300, RATE)
    late = plain - Edit(moved=((1.0, 1.5, 100.0),)).heard(300, RATE)
    np.testing.assert_allclose(late[(plain > 1.1) & (plain < 1.6)], 0.1)
    # Twice its shift before it and behind it all is as it was, to the bit.
    assert not late[(plain < 0.8) | (plain > 1.7)].any()
    assert (late >= -1e-9).all()
    assert np.abs(np.diff(late)).max() <= 0.01 + 1e-9  # no jump
    early = plain - Edit(shift=40, moved=((1.0, 1.5, -100.0),)).heard(300, RATE)
    np.testing.assert_allclose(early[(plain > 0.94) & (plain < 1.44)], 0.04 - 0.1)
    np.testing.assert_allclose(early[(plain < 0.8) | (plain > 1.8)], 0.04)


def test_parts_that_are_near_go_over_into_one_another() -> None:
    moved = ((1.0, 1.2, 100.0), (1.3, 1.5, 40.0))
    plain = Edit().heard(300, RATE)
    late = plain - Edit(moved=moved).heard(300, RATE)
    np.testing.assert_allclose(late[(plain > 1.1) & (plain < 1.3)], 0.1)
    np.testing.assert_allclose(late[(plain > 1.34) & (plain < 1.54)], 0.04)
    between = late[(plain > 1.3) & (plain < 1.34)]
    assert (np.diff(between) < 0).all()


def test_no_mouth_goes_back_whatever_is_moved() -> None:
    random = np.random.default_rng(0)
    for _ in range(200):
        count = int(random.integers(1, 6))
        at = np.sort(random.uniform(0, 3, 2 * count)).reshape(-1, 2)
        moved = tuple((low, high, float(random.uniform(-500, 500))) for low, high in at)
        heard = Edit(moved=moved).heard(400, RATE)
        assert (np.diff(heard) >= -1e-9).all(), moved
