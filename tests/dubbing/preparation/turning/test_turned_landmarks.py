"""Landmarks of turned heads: where the pose shows them, moved as the lips were seen to move."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER, RIGID
from dubbing.face.mouth.mouth_shape import INNER_LIP, LIPS, OUTER_LIP
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.turning.turned_landmarks import OUTER, filled_landmarks, outer_lips

FOCAL, DISTANCE, FRAMES, FRONT = 60000.0, 900.0, 120, 20  # far: landmarks know no perspective
PX = FOCAL / DISTANCE  # of a head unit
LOWER = [*OUTER[1], *INNER_LIP[1:10]]  # what moves as the mouth opens
OPENED = np.maximum(0, np.sin(np.arange(FRAMES)))
SPEECH = {
    "all the time": OPENED,
    "the lips stay shut": np.where(np.arange(FRAMES) < FRONT, OPENED, 0),
    "the lips hardly shut": np.where(np.arange(FRAMES) < FRONT, OPENED, 0.5 + OPENED),
}


def face() -> np.ndarray:
    """A shape (478, 3) of points anywhere, with shut lips."""
    shape = np.random.default_rng(0).normal(size=(478, 3))
    shape[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]] = [-1, -1, 0], [1, -1, 0]
    for points, first, second in ((OUTER_LIP, -0.2, 0.2), (INNER_LIP, 0.0, 0.0)):
        angle = np.linspace(0, 2 * np.pi, len(points), endpoint=False)
        high = np.where(np.sin(angle) > 0, second, first) * np.abs(np.sin(angle)) + 1
        shape[list(points)] = np.stack([-0.5 * np.cos(angle), high, 0 * angle], 1)
    return shape


@pytest.mark.parametrize("opening", SPEECH.values(), ids=SPEECH.keys())
def test_a_turned_face_lies_where_its_pose_shows_it(opening: np.ndarray) -> None:
    yaw = np.where(np.arange(FRAMES) < FRONT, 0, 50 + 15 * np.sin(np.arange(FRAMES) / 9))
    turn = Rotation.from_euler("Y", yaw[:, None], degrees=True).as_matrix()
    poses = Poses(turn, np.tile([0.0, 0.0, DISTANCE], (FRAMES, 1)))
    centre = np.full((FRAMES, 2), 128.0)
    true = np.tile(face(), (FRAMES, 1, 1))
    true[:, LOWER, 1] += opening[:, None]
    # What speech moves is distorted, the more, the further the head is turned: all alike, so that
    # lips are seen as high as they are.
    wrong = np.zeros((FRAMES, 478, 3))
    wrong[:, ~np.isin(np.arange(478), RIGID)] = np.sin(np.radians(yaw))[:, None, None] * [1, 2, 0]
    seen = project(to_camera(poses, true), FOCAL, centre)
    points = to_camera(poses, true + wrong)
    points = np.dstack([project(points, FOCAL, centre), (points[..., 2] - DISTANCE) * PX])
    detected: dict[str, Any] = {"points": points, "valid": np.ones(FRAMES, bool)}
    observed: Any = SimpleNamespace(focal=FOCAL, centre=centre)
    mean = true[:FRONT].mean(0)
    found, shift = filled_landmarks(detected, np.arange(FRAMES) < FRONT, mean, poses, observed)
    still = ~np.isin(np.arange(478), LIPS)
    assert np.abs(found - seen)[:, still].max() < 1.0  # the distortion is up to 200 px
    assert np.abs((found - seen)[:, LIPS] + shift).max() < 1.0
    # Landmarks are the same from all sides: opened as far in the mean as those from the front.
    ahead, turned = (outer_lips(found[k])[:, 1] for k in (slice(FRONT), slice(FRONT, None)))
    assert turned.mean() == pytest.approx(ahead.mean(), abs=0.05 * PX)
    told = opening[FRONT:]
    if told.any():
        assert np.corrcoef(turned, told)[0, 1] > 0.99
        assert np.std(turned) > 0.8 * np.std(told) * PX
