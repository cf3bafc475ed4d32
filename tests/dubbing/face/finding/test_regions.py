"""Regions of an image that networks look at."""

import cv2
import numpy as np
import pytest

from dubbing.face.finding.box_detector import FACES, merge
from dubbing.face.finding.face_finder import distinct
from dubbing.face.finding.regions import Region, overlap


def test_points_go_where_their_pixels_came_from() -> None:
    region = Region(40, 30, 20, 0.4)
    row, column = np.mgrid[:64, :80].astype(np.uint8)
    cut = region.cut(np.stack((column, row, row), -1), 10, cv2.BORDER_REPLICATE)
    row, column = np.mgrid[:10, :10]
    placed = region.place(np.stack((column, row), -1) / 10)
    np.testing.assert_allclose(cut[..., :2], placed, atol=0.6)


def test_depth_has_the_unit_of_the_columns() -> None:
    placed = Region(40, 30, 20, np.pi / 2).place(np.array([[0.5, 0.5, 0.1], [1.0, 0.5, 0.0]]))
    np.testing.assert_allclose(placed, [[40, 30, 2], [40, 40, 0]], atol=1e-9)


def test_a_region_is_turned_with_the_eyes() -> None:
    eyes = np.array([[10.0, 10.0], [20.0, 20.0]])
    assert Region.around(eyes, eyes).rotation == pytest.approx(np.pi / 4)


@pytest.mark.parametrize("degrees", [-160, -90, -45, -30, 0, 10, 31, 90])
def test_the_region_of_a_tilted_face_is_as_large_as_that_of_an_upright_one(degrees: float) -> None:
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    points = np.array([[10.0, 10.0], [20.0, 10.0], [5.0, 0.0], [35.0, 40.0]])
    region, upright = (Region.around(some, some[:2]) for some in (points @ turn, points))
    assert region.rotation == pytest.approx(angle)
    assert (upright.column, upright.row, upright.side) == (20, 20, 60)
    if abs(degrees) >= 30:  # below, as in the published graphs
        np.testing.assert_allclose([region.column, region.row], [20, 20] @ turn, atol=1e-9)
        assert region.side == pytest.approx(60)


def test_overlap_is_a_share_of_both() -> None:
    assert overlap(Region(0, 0, 2), Region(1, 0, 2)) == pytest.approx(1 / 3)
    assert overlap(Region(0, 0, 4), Region(0, 0, 2)) == pytest.approx(1 / 4)
    assert overlap(Region(0, 0, 2), Region(2, 0, 2)) == 0


def test_the_later_of_two_regions_of_one_face_stays() -> None:
    first, again, other = Region(0, 0, 10), Region(1, 0, 10), Region(20, 0, 10)
    assert distinct([first, other, again]) == [other, again]


def test_boxes_of_one_face_are_averaged_by_their_scores() -> None:
    values = np.zeros((3, 8))
    values[:, :4] = [[0.5, 0.5, 0.2, 0.2], [0.9, 0.5, 0.1, 0.1], [0.52, 0.5, 0.2, 0.2]]
    faces = merge(values, np.array([0.6, 0.7, 0.9]))
    np.testing.assert_allclose([face[0] for face in faces], [0.512, 0.9])


def test_there_is_an_anchor_in_every_cell() -> None:
    anchors = FACES.anchors()
    assert anchors.shape == (896, 2)
    np.testing.assert_allclose(
        anchors[[0, 1, 2, 512, 895]],
        [
            [1 / 32, 1 / 32],
            [1 / 32, 1 / 32],
            [3 / 32, 1 / 32],
            [1 / 16, 1 / 16],
            [15 / 16, 15 / 16],
        ],
    )
