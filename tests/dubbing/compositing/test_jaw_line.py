"""How far the film's outline lies beside a learned head's."""

import numpy as np
import pytest

from dubbing.compositing.jaw_line import (
    ANGLES,
    MOST,
    beside,
    jaw_lines,
    radii,
)
from dubbing.face.face_contour import face_contour
from tests import fakes

S = 512
LIPS = [0, 17, 61, 291]  # of FaceMesh: the middles of the lips, and the corners
LANDMARKS = fakes.face(S)
LANDMARKS[LIPS] = [(256, 315), (256, 345), (220, 330), (292, 330)]
CONTOUR = face_contour(LANDMARKS, S)
DOWN = len(ANGLES) // 4  # of `ANGLES`
UP = 3 * DOWN
CHIN = radii(CONTOUR.region, CONTOUR.middle)[DOWN]


def disc(radius: float) -> np.ndarray:
    """A head (S, S) uint8 round the middle of the face, with a soft edge."""
    x, y = np.arange(S) - CONTOUR.middle[:, None]
    return (255 * np.clip(0.5 + radius - np.hypot(y[:, None], x), 0, 1)).round().astype(np.uint8)


@pytest.mark.parametrize("radius", [60.0, 100.3, 150.7])
def test_an_outline_is_found_to_a_part_of_a_pixel(radius: float) -> None:
    np.testing.assert_allclose(radii(disc(radius), CONTOUR.middle), radius, atol=0.3)


def test_where_there_is_no_head_there_is_no_outline() -> None:
    assert np.isnan(radii(np.zeros((S, S), np.uint8), CONTOUR.middle)).all()


def test_outlines_are_compared_round_the_jaw_alone() -> None:
    found = beside(disc(CHIN + 5), disc(CHIN), CONTOUR)
    assert found[DOWN] == pytest.approx(5, abs=0.4)
    assert np.isnan(found[UP])


def test_an_outline_far_away_is_another_things() -> None:
    assert beside(disc(CHIN + 25), disc(CHIN), CONTOUR)[DOWN] == MOST
    assert np.isnan(beside(disc(CHIN + 40), disc(CHIN), CONTOUR)[DOWN])


def test_a_jaw_line_between_looks_lies_between_theirs() -> None:
    looked = np.array([3, 6, 9, 12])
    jaws = [np.full(len(ANGLES), offset) for offset in (2.0, 4.0, 6.0, 8.0)]
    found = jaw_lines(looked, jaws, np.arange(3, 13))
    np.testing.assert_allclose(found[3:7, 0], np.linspace(4, 6, 4), rtol=1e-6)
    assert np.isfinite(found).all()


def test_a_jaw_line_of_one_look_alone_is_chance() -> None:
    jaws = [np.zeros(len(ANGLES)) for _ in range(5)]
    jaws[2][:] = 9.0
    jaws[3][10] = -9.0
    assert not jaw_lines(np.arange(5), jaws, np.arange(5)).any()


def test_where_no_jaw_line_is_known_nothing_is_moved() -> None:
    jaws = [np.full(len(ANGLES), np.nan) for _ in range(3)]
    jaws[1][4:9] = 3.0
    found = jaw_lines(np.arange(3), jaws, np.arange(3))
    np.testing.assert_array_equal(found[:, 5:8], 3.0)
    assert not found[:, 20:].any()
    assert not jaw_lines(np.zeros(0, int), [], np.arange(3)).any()
