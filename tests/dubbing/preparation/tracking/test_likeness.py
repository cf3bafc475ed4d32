"""How alike two faces look."""

import numpy as np

from dubbing.face.mesh_points import RIGID
from dubbing.preparation.tracking.likeness import COLOUR_SCALE, FARTHEST, PARTS, apart

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
