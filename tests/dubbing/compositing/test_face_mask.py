"""What of a picture a rendered head may replace."""

import numpy as np
import pytest

from dubbing.compositing.face_mask import (
    ABOVE,
    BELOW,
    INSIDE,
    OUTSIDE,
    face_mask,
    lower_share,
    rendered_region,
)
from dubbing.face.face_contour import face_contour
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER

S = 256


EYES, NOSE = -25, 0  # px below the middle of the face


def landmarks(roll: float = 0.0) -> np.ndarray:
    """A face whose oval is a circle of 60 px, forehead up; rolled by so many degrees."""
    points = np.zeros((478, 2))
    angle = np.arange(len(FACE_OVAL)) * 2 * np.pi / len(FACE_OVAL)
    points[list(FACE_OVAL)] = 60 * np.stack([np.sin(angle), -np.cos(angle)], -1)
    points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] = [[-30, EYES], [30, EYES]]
    points[NOSE_BASE] = [0, NOSE]
    cos, sin = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    return 128 + points @ np.array([[cos, sin], [-sin, cos]])


def mask_of(points: np.ndarray, size: int) -> np.ndarray:
    return face_mask(points, face_contour(points, size))


@pytest.mark.parametrize("roll", [0.0, 40.0, -75.0])
def test_the_lower_face_and_the_room_round_its_jaw(roll: float) -> None:
    share = mask_of(landmarks(roll), S)

    def at(degrees: float, radius: float) -> int:
        """Of the pixel so many degrees from the chin, as the head is held."""
        angle = np.radians(degrees + roll + 180)
        return int(share[round(128 - radius * np.cos(angle)), round(128 + radius * np.sin(angle))])

    inside, outside = INSIDE * S / 512, OUTSIDE * S / 512
    for degrees in range(-75, 90, 15):
        assert at(degrees, 58 - inside) == 255
    for degrees in (-35, 0, 35):
        assert at(degrees, 60) == at(degrees, 110) == 255
    for degrees in (-170, -90, -65, 65, 90, 180):
        assert at(degrees, 62 + outside) == at(degrees, 110) == 0
    for degrees in (-65, 65, 80):
        assert 60 < at(degrees, 60 + (outside - inside) / 2) < 200
    # Between the jaw and the cheek less and less of it.
    assert 255 > at(45, 100) > at(50, 100) > at(55, 100) > 0
    # Up the middle of the face.
    below_the_eyes, beside_the_nose = (EYES + part * (NOSE - EYES) for part in (ABOVE, BELOW))
    for up in range(60, 0, -5):
        assert at(180, up) == 0 or -up > below_the_eyes - 1
    assert at(0, 0) == 255
    assert at(180, 1 - below_the_eyes) == 0
    assert 60 < at(180, -(below_the_eyes + beside_the_nose) / 2) < 200


def test_it_rises_all_the_way_from_the_eyes_to_the_mouth() -> None:
    share = mask_of(landmarks(), S).astype(int)
    columns = share[128 + EYES : 128 + 20, 128 - 40 : 128 + 41]
    assert (np.diff(columns, axis=0) >= 0).all()
    assert (columns[0] == 0).all()
    assert (columns[-1] == 255).all()
    assert np.diff(columns, axis=0).max() < 40  # no hard edge across the cheeks


def test_both_sides_are_treated_alike() -> None:
    share = mask_of(landmarks(), S)[:, 1:].astype(int)  # column 128 is the middle
    assert np.abs(share - share[:, ::-1]).mean() < 0.5  # the outline is drawn to a pixel or so
    points = landmarks(12)
    seen = lower_share(points, S)
    points[:, 0] = S - 1 - points[:, 0]
    points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] = points[[RIGHT_EYE_OUTER, LEFT_EYE_OUTER]]
    np.testing.assert_allclose(lower_share(points, S)[:, ::-1], seen, atol=1e-9)


def test_a_nose_towards_the_camera_leaves_the_lids_to_the_film() -> None:
    points = landmarks()
    points[NOSE_BASE] = (128, 128 + EYES)
    assert (mask_of(points, S)[: 128 + EYES + 5] == 0).all()


def test_the_region_to_render_holds_the_mask_and_what_decides_about_it() -> None:
    share = mask_of(landmarks(), S)
    region = rendered_region(landmarks(), S)
    assert region[share > 0].all()
    rows = np.flatnonzero((share > 0).any(1))
    assert region[rows[0] - 10, 128]
    assert not region[: rows[0] - 20].any()


def test_lengths_follow_the_crop() -> None:
    small, large = mask_of(landmarks(), S), mask_of(landmarks() * 2 + 0.5, 2 * S)
    assert small.dtype == np.uint8
    assert np.abs(large[::2, ::2].astype(int) - small).mean() < 2
