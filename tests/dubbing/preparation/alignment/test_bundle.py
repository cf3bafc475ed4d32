"""Poses and shape from landmarks, against numeric derivatives and known truth."""

import numpy as np
import pytest

from dubbing.preparation.alignment.bundle import Observations, fit_poses, start_poses, triangulate
from dubbing.preparation.alignment.camera import (
    Poses,
    point_jacobian,
    pose_jacobian,
    project,
    rotation_from_vector,
    to_camera,
    vector_from_rotation,
)

FOCAL = 1200.0
FRAMES = 60


@pytest.fixture
def head() -> np.ndarray:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.7, 0.7, 60), rng.uniform(-0.8, 0.6, 60)
    return np.stack((x, y, -1 + x**2 + 0.3 * y**2 - 0.2 * (np.hypot(x, y) < 0.2)), axis=1)


@pytest.fixture
def truth() -> Poses:
    t = np.arange(FRAMES)[:, None] / 25
    turn = np.deg2rad([4.0, 12.0, 3.0]) * np.sin(2 * np.pi * t * [0.4, 0.3, 0.5] + [0, 1, 2])
    sway = np.sin(2 * np.pi * t * [0.3, 0.2, 0.25])
    shift = np.array([0.1, -0.05, 8.0]) + np.array([0.2, 0.1, 0.3]) * sway
    return Poses(rotation_from_vector(turn), shift)


def observe(head: np.ndarray, truth: Poses, noise: float = 0.0) -> Observations:
    centre = np.tile([250.0, 260.0], (FRAMES, 1))
    pixels = project(to_camera(truth, head), FOCAL, centre)
    pixels = pixels + np.random.default_rng(1).normal(0, noise, pixels.shape)
    linked = np.ones(FRAMES, bool)
    linked[[0, -1]] = False
    return Observations(pixels, np.ones(FRAMES), linked, FOCAL, centre, 25.0)


def turn_error(poses: Poses, truth: Poses) -> np.ndarray:
    """Angles (T,) in degrees."""
    apart = vector_from_rotation(poses.rotation @ truth.rotation.transpose(0, 2, 1))
    return np.rad2deg(np.linalg.norm(apart, axis=1))


def test_pose_jacobian_is_the_numeric_one(head: np.ndarray, truth: Poses) -> None:
    centre = np.zeros((FRAMES, 2))
    analytic = pose_jacobian(to_camera(truth, head), truth.translation, FOCAL)
    for k in range(6):
        step = np.zeros((FRAMES, 6))
        step[:, k] = 1e-5
        ahead = project(to_camera(truth.stepped(step), head), FOCAL, centre)
        behind = project(to_camera(truth.stepped(-step), head), FOCAL, centre)
        np.testing.assert_allclose(analytic[..., k], (ahead - behind) / 2e-5, rtol=1e-5, atol=1e-4)


def test_point_jacobian_is_the_numeric_one(head: np.ndarray, truth: Poses) -> None:
    centre = np.zeros((FRAMES, 2))
    in_camera = to_camera(truth, head)
    analytic = point_jacobian(in_camera, FOCAL)
    for k in range(3):
        step = 1e-5 * np.eye(3)[k]
        slope = project(in_camera + step, FOCAL, centre) - project(in_camera - step, FOCAL, centre)
        np.testing.assert_allclose(analytic[..., k], slope / 2e-5, rtol=1e-5, atol=1e-4)


def test_exact_landmarks_give_exact_poses(head: np.ndarray, truth: Poses) -> None:
    seen = observe(head, truth)
    start = truth.stepped(np.random.default_rng(2).normal(0, 0.03, (FRAMES, 6)))
    poses = fit_poses(head, start, seen, steps=15)
    # The smoothness bends the quickest motion by a trace.
    assert turn_error(poses, truth).max() < 0.02
    assert np.abs(poses.translation - truth.translation).max() < 5e-3


def test_noisy_landmarks_with_outliers(head: np.ndarray, truth: Poses) -> None:
    seen = observe(head, truth, noise=0.5)
    seen.pixels[10, :6] += 30  # a tenth of the points of a frame is wrong
    poses = fit_poses(head, start_poses(head, seen), seen)
    assert np.sqrt((turn_error(poses, truth) ** 2).mean()) < 0.2
    assert turn_error(poses, truth)[10] < 0.6


def test_a_hidden_frame_is_carried_by_its_neighbours(head: np.ndarray, truth: Poses) -> None:
    seen = observe(head, truth)
    seen.confidence[30:33] = 0
    seen.pixels[30:33] = 0
    poses = fit_poses(head, start_poses(head, seen), seen)
    assert turn_error(poses, truth)[30:33].max() < 0.5


def test_points_are_triangulated_from_known_poses(head: np.ndarray, truth: Poses) -> None:
    seen = observe(head, truth, noise=0.3)
    prior = head + np.random.default_rng(3).normal(0, 0.02, head.shape)
    found = triangulate(prior, seen.pixels, truth, seen)
    assert np.sqrt(((found - head) ** 2).mean()) < 0.3 * np.sqrt(((prior - head) ** 2).mean())
