"""Tilt and depth of a face, read off the outline of its profile."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.face.mesh_points import CHIN, FOREHEAD_TOP, NOSE_BASE
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.turning.profile_outline import FEWEST, outlined
from dubbing.preparation.turning.turned import Footage

SIDE, FOCAL, FRAMES = 300, 750.0, 24
HALF_WIDTH = 0.7


@pytest.fixture
def mesh() -> np.ndarray:
    """A face (478, 3): y down from -1 to 1, its front at z = -1."""
    random = np.random.default_rng(0)
    points = np.stack([random.uniform(-HALF_WIDTH, HALF_WIDTH, 478), random.uniform(-1, 1, 478)], 1)
    points[:120, 0] = 0  # the middle line
    points[:120, 1] = np.linspace(-0.99, 0.99, 120)
    points[[FOREHEAD_TOP, NOSE_BASE, CHIN]] = (0, -1), (0, 0.1), (0, 1)
    return np.column_stack([points, points[:, 0] ** 2 - 1])


def footage_of(shape: np.ndarray, poses: Poses) -> Any:
    """Person masks of a head with that face, filled from its outline to behind the ears."""
    centre = np.full((len(poses), 2), (SIDE - 1) / 2)
    masks = []
    back = shape * [1, 1, 0] + [0, 0, 0.9]
    for front, rear in zip(
        *(project(to_camera(poses, part), FOCAL, centre) for part in (shape, back)), strict=True
    ):
        mask = np.zeros((SIDE, SIDE), np.uint8)
        order = np.argsort(shape[:120, 1])
        edge = np.concatenate([front[:120][order], rear[:120][order][::-1]])
        cv2.fillPoly(mask, [(edge * 16).round().astype(np.int32)], 255, shift=4)
        masks.append(mask)
    surface = type("Surface", (), {"focal": FOCAL})
    people = np.stack(masks)
    return Footage(people[..., None], people, centre, np.zeros(len(poses), int), surface())


def turned(yaw: np.ndarray) -> tuple[Poses, np.ndarray]:
    turn = Rotation.from_euler("Y", yaw[:, None], degrees=True).as_matrix()
    return Poses(turn, np.tile([0.0, 0.0, 9.0], (len(yaw), 1))), np.radians(np.abs(yaw))


@pytest.mark.parametrize("side", [1, -1])
def test_lips_that_stand_out_too_far_are_put_back(mesh: np.ndarray, side: int) -> None:
    true = mesh.copy()
    true[:, 2] += 0.2 * np.exp(-(((mesh[:, 1] - 0.5) / 0.15) ** 2))
    poses, turn = turned(side * np.linspace(70, 88, FRAMES))
    found, _ = outlined(mesh, poses, turn, footage_of(true, poses))
    middle = np.abs(mesh[:, 0]) < 0.3
    assert np.abs(found - true)[middle & (np.abs(mesh[:, 1]) < 0.9)].max() < 0.06
    np.testing.assert_array_equal(found[:, :2], mesh[:, :2])


@pytest.mark.parametrize("side", [1, -1])
def test_heads_that_drifted_are_turned_back(mesh: np.ndarray, side: int) -> None:
    true, turn = turned(side * np.concatenate([np.linspace(0, 52, 20), np.full(40, 75.0)]))
    tilt = Rotation.from_rotvec([0, 0, np.radians(4)]).as_matrix()
    drifted = Poses(tilt @ true.rotation, true.translation)
    _, found = outlined(mesh, drifted, turn, footage_of(mesh, true))
    left = Rotation.from_matrix(true.rotation @ found.rotation.transpose(0, 2, 1)).magnitude()
    assert np.degrees(left[25:]).max() < 1
    np.testing.assert_array_equal(
        found.rotation[turn < np.radians(50)], drifted.rotation[turn < np.radians(50)]
    )
    np.testing.assert_array_equal(found.translation, true.translation)


def test_what_covers_a_profile_for_a_moment_says_nothing(mesh: np.ndarray) -> None:
    poses, turn = turned(np.linspace(70, 88, FRAMES))
    footage = footage_of(mesh, poses)
    footage.people[: FRAMES // 3, 150:200] = 255  # an arm across the picture
    found, _ = outlined(mesh, poses, turn, footage)
    assert np.abs(found - mesh)[np.abs(mesh[:, 1]) < 0.9].max() < 0.04


def test_hair_before_a_face_says_nothing(mesh: np.ndarray) -> None:
    poses, turn = turned(np.linspace(70, 88, FRAMES))
    hair = mesh.copy()
    hair[:, 2] -= 0.4 * (np.abs(mesh[:, 1] + 0.6) < 0.3)
    found, _ = outlined(mesh, poses, turn, footage_of(hair, poses))
    assert np.abs(found - mesh)[np.abs(mesh[:, 1]) < 0.9].max() < 0.15


def test_without_profiles_nothing_changes(mesh: np.ndarray) -> None:
    poses, turn = turned(np.linspace(0, 40, FRAMES))
    footage = footage_of(mesh, poses)
    assert outlined(mesh, poses, turn, footage) == (mesh, poses)
    turn[: FEWEST - 1] = np.radians(80)
    turn[FEWEST:] = np.nan
    assert outlined(mesh, poses, turn, footage) == (mesh, poses)
