"""What of a picture a rendered head may replace."""

import numpy as np
import pytest

from dubbing.compositing.face_mask import CHIN, INSIDE, OUTSIDE, face_mask
from dubbing.face.mesh_points import FACE_OVAL

S = 256


def landmarks(roll: float = 0.0) -> np.ndarray:
    """A face whose oval is a circle of 60 px, forehead up; rolled by so many degrees."""
    points = np.zeros((478, 2))
    angle = np.arange(len(FACE_OVAL)) * 2 * np.pi / len(FACE_OVAL) + np.radians(roll)
    points[list(FACE_OVAL)] = 128 + 60 * np.stack([np.sin(angle), -np.cos(angle)], -1)
    return points


@pytest.mark.parametrize("roll", [0.0, 40.0, -75.0])
def test_the_face_and_the_room_round_its_jaw(roll: float) -> None:
    share = face_mask(landmarks(roll), S)

    def at(degrees: float, radius: float) -> int:
        """Of the pixel so many degrees from the chin, as the head is held."""
        angle = np.radians(degrees + roll + 180)
        return int(share[round(128 - radius * np.cos(angle)), round(128 + radius * np.sin(angle))])

    inside, outside = INSIDE * S / 512, OUTSIDE * S / 512
    for degrees in range(-180, 180, 15):
        assert at(degrees, 58 - inside) == 255
    for degrees in (-35, 0, 35):
        assert at(degrees, 60) == at(degrees, 110) == 255
    for degrees in (-170, -90, -65, 65, 90, 180):
        assert at(degrees, 62 + outside) == at(degrees, 110) == 0
        assert 60 < at(degrees, 60 + (outside - inside) / 2) < 200
    # Between the jaw and the cheek less and less of it.
    assert 255 > at(45, 100) > at(50, 100) > at(55, 100) > 0


def test_lengths_follow_the_crop() -> None:
    small, large = face_mask(landmarks(), S), face_mask(landmarks() * 2 + 0.5, 2 * S)
    assert small.dtype == np.uint8
    assert np.abs(large[::2, ::2].astype(int) - small).mean() < 2


def test_the_chin_is_where_the_oval_is_lowest() -> None:
    assert landmarks()[FACE_OVAL[CHIN], 1] == pytest.approx(188)
