"""What of a picture a rendered head may replace."""

import numpy as np
import pytest

from dubbing.compositing.face_mask import (
    ABOVE,
    BESIDE_NOSE,
    INSIDE,
    OUTSIDE,
    face_mask,
    lower_share,
    rendered_region,
)
from dubbing.face import mesh_points
from dubbing.face.face_contour import face_contour
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.face.mouth.mouth_shape import OUTER_LIP

S = 256
WHOLE = slice(0, S), slice(0, S)


EYES, NOSE, MOUTH = -25, 0, 22  # px below the middle of the face


def landmarks(roll: float = 0.0) -> np.ndarray:
    """A face whose oval is a circle of 60 px, forehead up; rolled by so many degrees."""
    points = np.zeros((478, 2))
    angle = np.arange(len(FACE_OVAL)) * 2 * np.pi / len(FACE_OVAL)
    points[list(FACE_OVAL)] = 60 * np.stack([np.sin(angle), -np.cos(angle)], -1)
    points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] = [[-30, EYES], [30, EYES]]
    points[NOSE_BASE] = [0, NOSE]
    points[list(mesh_points.NOSE)] = [0, EYES]  # of no size
    points[list(OUTER_LIP)] = [0, MOUTH]
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
    for degrees in (-10, 0, 10):
        assert at(degrees, 58 - inside) == at(degrees, 62) == 255
    for degrees in (-170, -90, -65, 65, 90, 180):
        assert at(degrees, 62 + outside) == at(degrees, 110) == 0
    # Beyond the chin, and towards the corners of the jaw, less and less of it.
    assert 255 > at(0, 75) > at(0, 80) > at(0, 84) > 0 == at(0, 90)
    assert 255 > at(40, 50) > at(50, 50) > at(60, 50) > 0 == at(75, 50)
    # Up the middle of the face.
    below_the_eyes = EYES + ABOVE * (NOSE - EYES)
    for up in range(60, 0, -5):
        assert at(180, up) == 0 or -up > below_the_eyes - 1
    assert at(0, 0) == at(0, MOUTH) == 255


def test_it_rises_all_the_way_from_the_eyes_to_the_mouth() -> None:
    share = mask_of(landmarks(), S).astype(int)
    columns = share[128 + EYES : 128 + MOUTH, 128 - 40 : 128 + 41]
    assert (np.diff(columns, axis=0) >= 0).all()
    assert (columns[0] == 0).all()
    assert (columns[-1, 10:-10] == 255).all()
    assert np.diff(columns, axis=0).max() < 40  # no hard edge across the cheeks


def with_nose(points: np.ndarray) -> np.ndarray:
    """The face with a nose: a triangle from between the eyes to its base, 24 px wide."""
    points[list(mesh_points.NOSE)] = (128 + 12, 128 + NOSE)
    points[list(mesh_points.NOSE)[:2]] = (128, 128 + EYES), (128 - 12, 128 + NOSE)
    return points


def test_the_nose_is_the_films_own() -> None:
    """Words hardly move it; light and nostrils are those of the frame."""
    share, without = mask_of(with_nose(landmarks()), S), mask_of(landmarks(), S)
    below = 128 + NOSE + round(BESIDE_NOSE * S / 512) + 1
    assert (share[below:] == without[below:]).all()
    assert (share[128 + NOSE, 128 - 12 : 128 + 13] == 0).all()
    rise = share[128 + NOSE : below, 128].astype(int)
    assert (np.diff(rise) > 0).all()
    assert share[128 + NOSE, 128 + 30] == without[128 + NOSE, 128 + 30] > 0


def test_lips_just_below_the_nose_are_replaced() -> None:
    """Of a head that nods."""
    points = with_nose(landmarks())
    points[list(OUTER_LIP)] = [128, 128 + NOSE + 4]
    share = mask_of(points, S)
    assert share[128 + NOSE + 4, 128] == 255 > share[128 + NOSE + 1, 128]


def test_a_cheek_that_a_turned_head_shows_is_the_films_own() -> None:
    """The mouth is at the edge of the face, as in a profile."""
    points = landmarks()
    points[list(OUTER_LIP)] = (128 + 40, 128 + MOUTH)
    share = mask_of(points, S)[128 + MOUTH]
    assert share[128 + 40] == share[128 + 15] == 255
    assert (share[: 128 - 10] == 0).all()


def test_both_sides_are_treated_alike() -> None:
    share = mask_of(landmarks(), S)[:, 1:].astype(int)  # column 128 is the middle
    assert np.abs(share - share[:, ::-1]).mean() < 0.5  # the outline is drawn to a pixel or so
    points = landmarks(12)
    seen = lower_share(points, WHOLE)
    points[:, 0] = S - 1 - points[:, 0]
    points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] = points[[RIGHT_EYE_OUTER, LEFT_EYE_OUTER]]
    np.testing.assert_allclose(lower_share(points, WHOLE)[:, ::-1], seen, atol=1e-9)


def test_a_profile_has_its_mouth_below_its_eyes() -> None:
    """Its eyes lie one before the other, in either order."""
    points = landmarks() * [0.1, 1] + [128 * 0.9, 0]
    both = []
    for order in (1, -1):
        points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER][::order]] = (126, 128 + EYES), (129, 131 + EYES)
        share = lower_share(points, WHOLE)
        assert share[128 + MOUTH].min() > 0.9
        assert share[128 + EYES].max() < 0.2
        both.append(share)
    assert np.abs(both[0] - both[1]).max() < 0.05


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
