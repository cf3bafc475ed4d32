"""How alike two faces look."""

import cv2
import numpy as np
import pytest

from dubbing.face.mesh_points import LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER, RIGID
from dubbing.preparation.tracking.likeness import COLOUR_SCALE, FARTHEST, PARTS, apart
from dubbing.preparation.tracking.likeness import looks as looks_of

SHAPE = np.random.default_rng(0).normal(0, 0.5, (len(RIGID), 3))


def looks(*spreads: float) -> np.ndarray:
    """Looks (1, D) whose parts have colours so many spreads off, the first parts first."""
    off = np.zeros(len(PARTS))
    off[: len(spreads)] = spreads
    return np.concatenate([SHAPE.ravel(), (off[:, None] * COLOUR_SCALE).ravel()])[None]


def test_a_caption_over_the_chin_makes_nobody_another_person() -> None:
    for part in range(len(PARTS)):
        covered = looks(*(12.0 * (k == part) for k in range(len(PARTS))))
        assert apart(looks(), covered) < FARTHEST


def test_somebody_of_other_colours_everywhere_is_another_person() -> None:
    assert apart(looks(), looks(*[2.2] * len(PARTS))) > FARTHEST


COLOURS = np.random.default_rng(3).uniform(
    (60, 135, 140, 5, 2, 2), (210, 165, 170, 30, 5, 5), (7, 6)
)


def coloured(colours: np.ndarray) -> np.ndarray:
    """Looks (1, D) of a face whose parts have colours (7, 6)."""
    return np.concatenate([SHAPE.ravel(), colours.ravel()])[None]


@pytest.mark.parametrize(
    ("gain", "offset"),
    [
        ((0.4, 0.6, 0.6), (10, 50, 52)),
        ((0.7, 1, 1), (70, 0, 0)),
        ((1, 0.4, 0.4), (0, 90, 75)),
        ((1, 0, 0), (0, 128, 128)),
    ],
    ids=["at night", "faded", "pale", "black and white"],
)
def test_another_light_makes_nobody_another_person(
    gain: tuple[float, ...], offset: tuple[float, ...]
) -> None:
    lit = np.concatenate([COLOURS[:, :3] * gain + offset, COLOURS[:, 3:] * gain], 1)
    for pair in ((COLOURS, lit), (lit, COLOURS)):
        assert apart(*map(coloured, pair)) < FARTHEST / 3


def test_other_colours_in_another_light_are_another_person() -> None:
    other = COLOURS[[3, 5, 0, 6, 1, 2, 4]]
    assert apart(coloured(COLOURS), coloured(other * (0.4, 0.6, 0.6, 0.4, 0.6, 0.6))) > FARTHEST


def test_what_a_close_up_cuts_off_makes_nobody_another_person() -> None:
    """A forehead, or a chin, that lies outside of the picture is not compared."""
    image = patches()
    face = np.full((478, 3), 150.0)
    face[:, :2] += np.random.default_rng(2).uniform(-60, 60, (478, 2))
    face[LEFT_EYE_OUTER, :2], face[RIGHT_EYE_OUTER, :2] = (110, 120), (190, 120)
    face[NOSE_BASE, :2] = 150, 163
    whole = looks_of(image, face)[None]
    assert np.isfinite(whole).all()
    for cut, moved in ((image[115:], 115), (image[:195], 0)):
        seen = looks_of(cut, face - np.array([0, moved, 0]))[None]
        assert np.isnan(seen).any()
        assert apart(whole, seen) < FARTHEST / 3
    mostly_whole = np.concatenate([whole, whole, seen])
    assert apart(mostly_whole, whole) == apart(whole, whole)


def patches() -> np.ndarray:
    coarse = np.random.default_rng(1).integers(90, 150, (30, 30, 3), np.uint8)
    return np.asarray(cv2.resize(coarse, (300, 300), interpolation=cv2.INTER_CUBIC))
