"""Poses and points are found together, from points that were followed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.turning.point_tracks import PointTracks
from dubbing.preparation.turning.structure import Structure

FOCAL, CENTRE = 600.0, np.array([128.0, 120.0])
FRAMES, POINTS, ANCHORED, SEEN = 40, 300, 6, 18


def truth() -> Poses:
    """A head that turns from the front to 65 degrees."""
    yaw = np.concatenate([np.zeros(ANCHORED), np.linspace(0, -65, FRAMES - ANCHORED)])
    turn = Rotation.from_euler("YX", np.stack([yaw, 0.05 * yaw], 1), degrees=True)
    shift = np.stack([0.004 * -yaw, 0 * yaw, 9.6 + 0.003 * -yaw], 1)
    return Poses(turn.as_matrix(), shift)


def seen(points: np.ndarray, poses: Poses, frame: np.ndarray) -> np.ndarray:
    in_camera = (poses.rotation[frame] @ points[..., None])[..., 0] + poses.translation[frame]
    return np.asarray(FOCAL * in_camera[:, :2] / in_camera[:, 2:] + CENTRE)


def tracks(rng: np.random.Generator, slide: float = 0.0) -> PointTracks:
    """Points of an ellipsoid, each seen for a while; a share of them slides over it."""
    places = rng.standard_normal((POINTS, 3))
    places *= np.array([0.75, 1.1, 0.95]) / np.linalg.norm(places, axis=1, keepdims=True)
    first = rng.integers(0, FRAMES - SEEN + 1, POINTS)
    point = np.repeat(np.arange(POINTS), SEEN)
    frame = (first[:, None] + np.arange(SEEN)).ravel()
    moved = places[point].copy()
    sliding = point < slide * POINTS
    moved[sliding, 0] += 0.012 * (frame - first[point])[sliding]
    pixels = seen(moved, truth(), frame) + rng.normal(0, 0.2, (len(point), 2))
    return PointTracks(point, frame, pixels, places + rng.normal(0, 0.12, places.shape))


def solved(given: PointTracks) -> np.ndarray:
    """Errors (FRAMES,) in degrees, from a start that turns far too little."""
    free = np.arange(FRAMES) >= ANCHORED
    vectors = Rotation.from_matrix(truth().rotation).as_rotvec()
    start = Poses(Rotation.from_rotvec(0.6 * vectors).as_matrix(), truth().translation)
    found = Structure(given, FOCAL, np.tile(CENTRE, (FRAMES, 1))).poses(start, free)
    assert (found.rotation[~free] == start.rotation[~free]).all()
    apart = Rotation.from_matrix(found.rotation @ truth().rotation.transpose(0, 2, 1))
    return np.asarray(np.degrees(apart.magnitude()))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_head_that_turns_far(seed: int) -> None:
    assert solved(tracks(np.random.default_rng(seed))).max() < 1.0


def test_points_that_slide_are_left_out() -> None:
    assert solved(tracks(np.random.default_rng(2), slide=0.2)).max() < 1.5
