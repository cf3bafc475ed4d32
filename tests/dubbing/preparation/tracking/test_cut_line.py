"""The line that cuts a head from its neck: from lobe to lobe, and along what a profile shows."""

import numpy as np

from dubbing.preparation.tracking.cut_line import cut_line
from tests import fakes

S = 256
MIDDLE, RADIUS = S / 2, S / 3
LEFT, RIGHT = (MIDDLE - RADIUS - 8, MIDDLE), (MIDDLE + RADIUS + 8, MIDDLE)


def line(left: tuple[float, float], right: tuple[float, float]) -> np.ndarray:
    return cut_line(fakes.face(S), np.array([left, right]), S)


def test_it_runs_from_lobe_to_lobe_along_the_jaw() -> None:
    found = line(LEFT, RIGHT)
    np.testing.assert_allclose(found[[0, -1]], [LEFT, RIGHT])
    away = np.hypot(*(found[8:-8] - MIDDLE).T)
    assert np.abs(away - RADIUS).max() < 2
    assert found[:, 1].max() > MIDDLE + RADIUS - 2


def test_a_lobe_that_the_face_covers_is_left_out() -> None:
    found = line(LEFT, (MIDDLE + 10, MIDDLE))
    assert np.hypot(*(found[-1] - MIDDLE)) > RADIUS - 2


def test_the_far_lobe_of_a_profile_is_left_out() -> None:
    """It shows beside the face, on the side of the near one: the line would go back to it."""
    behind = (MIDDLE - RADIUS - 5, MIDDLE - 12)
    found = line(LEFT, behind)
    assert found[-1, 0] > MIDDLE + RADIUS - 30
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 8
    turned = line((MIDDLE + RADIUS + 5, MIDDLE - 12), RIGHT)
    assert turned[0, 0] < MIDDLE - RADIUS + 30
