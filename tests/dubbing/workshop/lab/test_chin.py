"""Edges along the chin: one where it is, none where it was."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.workshop.lab.chin import (
    CHIN_LINE,
    ChinFigures,
    chin_figures,
    chin_ratios,
    distance_to_line,
    gradient_energies,
)

pytestmark = pytest.mark.medium


SIZE = 128
EYES = 50.0  # px between them
CLOSED, OPEN = 90.0, 106.0  # row of the chin


def marks(chin: float) -> np.ndarray:
    """Landmarks (478, 2) whose chin is a level line."""
    points = np.zeros((478, 2))
    points[LEFT_EYE_OUTER], points[RIGHT_EYE_OUTER] = (39, 40), (39 + EYES, 40)
    points[list(CHIN_LINE)] = [(x, chin) for x in np.linspace(30, 98, len(CHIN_LINE))]
    return points


def face(*chins: float) -> np.ndarray:
    """A face that steps down in grey at each of some rows."""
    picture = np.full((SIZE, SIZE, 3), 200, np.uint8)
    for chin in sorted(chins):
        picture[round(chin) + 1 :] -= 40
    return picture


def ratios(dub: np.ndarray, found: float, film: np.ndarray, was: float) -> dict[str, float]:
    return chin_ratios([chin_figures(dub, film, marks(found), marks(was))])


def test_a_chin_that_stays_has_one_edge() -> None:
    both = ratios(face(CLOSED), CLOSED, face(CLOSED), CLOSED)
    assert both == {"chin_ratio": pytest.approx(1)}  # the old chin is the new one


def test_a_chin_that_moved_has_one_edge_and_none_where_it_was() -> None:
    both = ratios(face(CLOSED), CLOSED, face(OPEN), OPEN)
    # Bands end in half circles, so one line's is as long as the other's.
    assert both["chin_ratio"] == pytest.approx(1, rel=0.05)
    assert both["old_chin_ratio"] == 0


def test_a_second_chin_is_seen_in_both_figures() -> None:
    both = ratios(face(CLOSED, OPEN), CLOSED, face(OPEN), OPEN)
    assert both["chin_ratio"] == pytest.approx(2, rel=0.05)
    assert both["old_chin_ratio"] == pytest.approx(1)


def test_a_washed_out_chin_is_below_one() -> None:
    soft = cv2.GaussianBlur(face(CLOSED), (0, 0), 3)
    assert ratios(soft, CLOSED, face(CLOSED), CLOSED)["chin_ratio"] < 0.3


def test_frames_are_added_up_before_they_are_divided_and_unknown_ones_left_out() -> None:
    frames = [ChinFigures(2, 1, 0, 0), ChinFigures(1, 5, 1, 4), ChinFigures()]
    assert chin_ratios(frames) == {"chin_ratio": 0.5, "old_chin_ratio": 0.25}
    assert chin_ratios([ChinFigures()]) == chin_ratios([]) == {}


def test_distances_are_those_of_a_loop() -> None:
    points = marks(60.0)[list(CHIN_LINE)]
    away = distance_to_line(points, SIZE)
    left, right = points[0, 0], points[-1, 0]
    for x, y in ((50, 60), (50, 70), (10, 60), (110, 40)):
        slow = np.hypot(max(left - x, 0, x - right), y - 60)
        assert away[y, x] == pytest.approx(slow, abs=0.5)


def test_gradient_energies_are_those_of_a_loop() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (6, 6, 3)).astype(np.uint8)
    grey = (0.299 * picture[..., 0] + 0.587 * picture[..., 1] + 0.114 * picture[..., 2]) / 255
    energy = gradient_energies(picture)
    for y in range(6):
        for x in range(6):
            across = grey[y, x + 1] - grey[y, x] if x < 5 else 0
            down = grey[y + 1, x] - grey[y, x] if y < 5 else 0
            assert energy[y, x] == pytest.approx(across**2 + down**2)
