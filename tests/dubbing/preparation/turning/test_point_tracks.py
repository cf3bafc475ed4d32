"""Corners are followed, and only those that are firm on the head."""

import cv2
import numpy as np

from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.turning.head_surface import CENTRE, RADII, HeadSurface
from dubbing.preparation.turning.point_tracks import SHORTEST, follow

S, FOCAL = 200, 480.0
SURFACE = HeadSurface(np.zeros((478, 3)), FOCAL)  # a mesh of no size: the ellipsoid alone
MIDDLE = np.array([S / 2, S / 2])
AHEAD = np.eye(3), np.array([0.0, 0.0, 9.0])


def test_a_pixel_lies_on_the_head() -> None:
    pixels = np.array([[100.0, 90], [120, 70], [10, 10]])
    places, firm = SURFACE.lifted(pixels, *AHEAD, MIDDLE)
    assert firm.tolist() == [True, True, False]
    on = np.square((places[:2] - CENTRE) / RADII).sum(1)
    np.testing.assert_allclose(on, 1, atol=1e-9)
    in_camera = places[:2] + AHEAD[1]
    again = FOCAL * in_camera[:, :2] / in_camera[:, 2:] + MIDDLE
    np.testing.assert_allclose(again, pixels[:2], atol=1e-9)


def test_neither_the_mouth_nor_the_outline_is_firm() -> None:
    in_camera = np.array([[0.0, 0.5, -0.7], [0.74, 0.0, 0.05]]) + AHEAD[1]
    pixels = FOCAL * in_camera[:, :2] / in_camera[:, 2:] + MIDDLE
    assert not SURFACE.lifted(pixels, *AHEAD, MIDDLE)[1].any()


def test_points_go_with_the_picture() -> None:
    rng = np.random.default_rng(0)
    drawn = cv2.GaussianBlur(rng.uniform(0, 255, (S, S + 40)), (0, 0), 1.5)
    wide = np.repeat(((drawn - drawn.mean()) * 3 + 128).clip(0, 255)[..., None], 3, 2)
    frames = [wide[:, 20 - 2 * k : 20 - 2 * k + S].astype(np.uint8) for k in range(8)]
    person = np.full((S, S), 255, np.uint8)
    poses = Poses(np.tile(AHEAD[0], (8, 1, 1)), np.tile(AHEAD[1], (8, 1)))
    centre = np.tile(MIDDLE, (8, 1))
    tracks = follow(iter(frames), iter([person] * 8), poses, centre, SURFACE)
    assert len(tracks.places) > 20
    assert np.bincount(tracks.point).min() >= SHORTEST
    for number in range(0, len(tracks.places), 7):
        own = tracks.point == number
        moved = np.diff(tracks.pixels[own], axis=0)
        np.testing.assert_allclose(moved, np.tile([2, 0], (len(moved), 1)), atol=0.15)
