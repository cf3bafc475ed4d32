"""The outline of a new head lies as far beside the film's as words move it."""

import numpy as np
import pytest

from dubbing.compositing.composite import replacement
from dubbing.compositing.jaw_line import (
    ANGLES,
    MOST,
    UNSURE,
    beside,
    beside_jaw,
    jaw_lines,
    moved,
    radii,
)
from dubbing.compositing.neck import Neck
from dubbing.face.face_contour import face_contour
from dubbing.preparation.film_frame import FilmFrame
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


def head(radius: float) -> np.ndarray:
    """A head (S, S, 4) whose colours tell places apart."""
    rows, columns = np.mgrid[:S, :S]
    colour = np.stack([rows // 2, columns // 2, np.full((S, S), 90)], 2)
    opacity = disc(radius)[..., None]
    return np.concatenate([colour * (opacity / 255), opacity], 2).round().astype(np.uint8)


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


@pytest.mark.parametrize("offset", [-12.0, -5.0, 5.0, 12.0])
def test_a_jaw_is_moved_and_lips_are_not(offset: float) -> None:
    before = head(CHIN)
    after = moved(before, np.full(len(ANGLES), offset), LANDMARKS, CONTOUR)
    outline = radii(after[..., 3], CONTOUR.middle)
    expected = offset - np.sign(offset) * UNSURE
    assert outline[DOWN] - CHIN == pytest.approx(expected, abs=1)
    assert outline[UP] == pytest.approx(CHIN, abs=0.5)
    for x, y in LANDMARKS[LIPS].round().astype(int):
        np.testing.assert_array_equal(after[y, x], before[y, x])


def test_what_differs_by_chance_moves_nothing() -> None:
    before = head(CHIN)
    for offset in (0.0, 1.0, -1.0):
        after = moved(before, np.full(len(ANGLES), offset), LANDMARKS, CONTOUR)
        np.testing.assert_array_equal(after, before)


def test_above_clothes_the_films_skin_fades_without_stripes() -> None:
    """The row where clothes begin jitters from column to column."""
    x = np.arange(S) - CONTOUR.middle[0]
    low = CONTOUR.middle[1] + np.sqrt(np.maximum((CHIN + 10.5) ** 2 - x**2, 0)) + np.arange(S) % 2
    neck = Neck(low, np.zeros(S), np.zeros(S), np.ones(S))
    share = beside_jaw(LANDMARKS, disc(CHIN), np.ones((S, S), bool), neck)
    middle = slice(S // 2 - 40, S // 2 + 40)
    beside_chin = share[round(CONTOUR.middle[1] + CHIN) + 2, middle]
    assert np.abs(np.diff(beside_chin)).max() < 0.03
    assert 0.2 < beside_chin.min() < beside_chin.max() < 0.8


def test_a_composite_has_the_jaw_where_the_film_has_it() -> None:
    """The head's chin is 8 px too high with the film's lips, and so it is with others."""
    wall, skin = np.full((S, S, 3), (20, 60, 120), np.uint8), np.array((200, 130, 110))
    matte = disc(CHIN)
    image = np.where(matte[..., None] > 127, skin, wall).astype(np.uint8)
    opacity = disc(CHIN - 8)[..., None]
    rendered = np.concatenate([skin * (opacity / 255), opacity], 2).round().astype(np.uint8)
    chins = []
    for jaw in (None, np.full(len(ANGLES), 8.0)):
        frame = FilmFrame(
            image, matte, wall, None, np.zeros(3), np.zeros(5), np.zeros(2), LANDMARKS, image, jaw
        )
        made, _ = replacement(frame, rendered)
        chins.append(int(np.flatnonzero(made[:, int(CONTOUR.middle[0]), 0] > 110)[-1]))
    assert chins[1] - chins[0] in range(5, 9)


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
