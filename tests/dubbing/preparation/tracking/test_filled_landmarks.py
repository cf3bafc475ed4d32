"""Landmarks of turned heads: where the pose shows them, moved as the lips were seen to move."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dubbing.face.mesh_points import RIGID
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.tracking.tracking import filled_landmarks

FOCAL, FRAMES, LIP = 600.0, 120, 14


def test_a_turned_face_lies_where_its_pose_shows_it() -> None:
    random = np.random.default_rng(0)
    yaw = np.where(np.arange(FRAMES) < 20, 0, 50 + 15 * np.sin(np.arange(FRAMES) / 9))
    turn = Rotation.from_euler("Y", yaw[:, None], degrees=True).as_matrix()
    poses = Poses(turn, np.tile([0.0, 0.0, 9.0], (FRAMES, 1)))
    centre = np.full((FRAMES, 2), 128.0)
    shape = random.normal(size=(478, 3))
    opening = np.maximum(0, np.sin(np.arange(FRAMES)))
    true = np.tile(shape, (FRAMES, 1, 1))
    true[:, LIP, 1] += opening - opening[20:].mean()
    # Points that move with the lips are distorted, the more, the further the head is turned.
    wrong = np.zeros((FRAMES, 478, 3))
    wrong[:, ~np.isin(np.arange(478), RIGID)] = np.sin(np.radians(yaw))[:, None, None] * [1, 2, 0]
    detected: dict[str, Any] = {"points": true + wrong, "valid": np.ones(FRAMES, bool)}
    seen = project(to_camera(poses, shape), FOCAL, centre)
    detected["points"][:20, :, :2] = seen[:20]
    observed: Any = SimpleNamespace(focal=FOCAL, centre=centre)
    found = filled_landmarks(detected, np.arange(FRAMES) < 20, shape, poses, observed)
    still = np.arange(478) != LIP
    assert np.abs(found - seen)[:, still].max() < 1.0  # the distortion is up to 200 px
    moved = (found - seen)[20:, LIP, 1]
    assert np.corrcoef(moved, opening[20:])[0, 1] > 0.99
    assert np.std(moved) > 0.8 * np.std(opening) * FOCAL / 12
