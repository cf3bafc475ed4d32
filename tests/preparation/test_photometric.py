"""Photometric refinement on a textured surface seen by a known camera."""

from pathlib import Path

import cv2
import numpy as np

from dubbing.preparation.bundle import Observations
from dubbing.preparation.camera import Poses, project, to_camera
from dubbing.preparation.face_strip import FaceStrip
from dubbing.preparation.photometric import Alignment, refine, residual_shift, root_mean_square
from dubbing.preparation.rotations import rotation_from_vector
from dubbing.preparation.skin import Skin

SIZE, FOCAL, FRAMES = 160, 375.0, 16


def plane_picture(texture: np.ndarray, pose: Poses, centre: np.ndarray) -> np.ndarray:
    """The plane z = 0 of the head frame, textured over -1..1, as the camera sees it."""
    camera = np.array([[FOCAL, 0, centre[0]], [0, FOCAL, centre[1]], [0, 0, 1]])
    to_plane = np.array([[2 / len(texture), 0, -1], [0, 2 / len(texture), -1], [0, 0, 1]])
    moved = np.column_stack((pose.rotation[0][:, :2], pose.translation[0]))
    grey = cv2.warpPerspective(
        texture, camera @ moved @ to_plane, (SIZE, SIZE), flags=cv2.INTER_AREA
    )
    return np.repeat(grey[..., None], 3, axis=2)


def test_jittered_poses_are_pulled_back_onto_the_pixels(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.normal(size=(400, 400)).astype(np.float32), (0, 0), 8)
    texture = np.clip(128 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)
    centre = np.tile([80.0, 80.0], (FRAMES, 1))
    t = np.arange(FRAMES)[:, None]
    truth = Poses(
        rotation_from_vector(np.deg2rad([3.0, 6.0, 2.0]) * np.sin(t * [0.2, 0.15, 0.1])),
        [0.0, 0, 8] + np.array([0.1, 0.05, 0.1]) * np.sin(t * [0.1, 0.2, 0.15]),
    )
    films = [plane_picture(texture, truth[k : k + 1], centre[k]) for k in range(FRAMES)]
    # The same scene, a third darker and flatter: gain and offset are free.
    films[5] = (films[5] * 0.6 + 20).astype(np.uint8)

    grid = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 40), np.linspace(-0.6, 0.6, 40)), -1)
    points = np.concatenate((grid.reshape(-1, 2), np.zeros((1600, 1))), axis=1)
    skin = Skin(points, np.tile([0.0, 0, -1], (1600, 1)))
    marks = points[::100]
    pixels = project(to_camera(truth, marks), FOCAL, centre)
    jitter = rng.normal(0, 0.4, (FRAMES, 1, 2))  # shared by all landmarks of a frame
    linked = np.ones(FRAMES, bool)
    linked[[0, -1]] = False
    seen = Observations(pixels + jitter, np.ones(FRAMES), linked, FOCAL, centre, 25.0)
    start = Poses(truth.rotation, truth.translation.copy())
    start.translation[:, :2] += jitter[:, 0] * 8 / FOCAL

    strip = FaceStrip.record(
        tmp_path / "strip.npy", films, project(to_camera(start, points), FOCAL, centre)
    )
    every = np.arange(FRAMES)
    judged = Alignment(skin.half(1), strip, FOCAL, centre)
    before = root_mean_square(residual_shift(start, every, judged))
    poses = refine(
        start, Alignment(skin.half(0), strip, FOCAL, centre), marks, seen, lambda _: None
    )
    after = root_mean_square(residual_shift(poses, every, judged))
    # The score sees the jitter that was put in, but for its mean, and that it is gone.
    put_in = root_mean_square((jitter - jitter.mean(0))[:, 0])
    assert 0.7 * put_in < before < 1.3 * put_in
    assert after < 0.1
    error = project(to_camera(poses, points), FOCAL, centre) - project(
        to_camera(truth, points), FOCAL, centre
    )
    # A shift of all frames together is not observable: the mean texture moves along.
    assert np.abs((error - error.mean(0)).mean(1)).max() < 0.15
