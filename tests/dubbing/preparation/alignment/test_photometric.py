"""Photometric refinement on a textured surface seen by a known camera."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.photometric import (
    Alignment,
    all_samples,
    refine,
    residual_shift,
    root_mean_square,
    texture_of,
)
from dubbing.preparation.alignment.relief import Relief, solve_relief
from dubbing.preparation.alignment.rotations import rotation_from_vector
from dubbing.preparation.alignment.skin import Skin

SIZE, FOCAL, FRAMES = 160, 375.0, 24


def dome(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Depth of the surface in the head frame, nearest in the middle."""
    return 0.6 * (x**2 + y**2)


def picture(texture: np.ndarray, pose: Poses, centre: np.ndarray) -> np.ndarray:
    """The dome, textured over -1..1, as the camera sees it."""
    rows, columns = np.mgrid[:SIZE, :SIZE]
    ray = np.stack(
        ((columns - centre[0]) / FOCAL, (rows - centre[1]) / FOCAL, np.ones_like(rows)), axis=-1
    )
    eye, ray = -pose.translation[0] @ pose.rotation[0], ray @ pose.rotation[0]
    at = eye + ray * (-eye[2] / ray[..., 2:])
    for _ in range(8):
        height = dome(at[..., 0], at[..., 1])
        at = eye + ray * ((height - eye[2]) / ray[..., 2])[..., None]
    place = ((at[..., :2] + 1) / 2 * len(texture)).astype(np.float32)
    grey = cv2.remap(texture, place[..., 0], place[..., 1], cv2.INTER_LINEAR)
    return np.repeat(grey[..., None], 3, axis=2)


@dataclass
class Scene:
    """A textured dome that moves, and landmarks on it that jitter all together."""

    truth: Poses
    start: Poses
    skin: Skin
    marks: np.ndarray
    seen: Observations
    jitter: np.ndarray
    strip: FaceStrip

    def work(self, skin: Skin) -> Alignment:
        return Alignment(skin, self.strip, FOCAL, self.seen.centre)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return filmed(tmp_path)


def filmed(folder: Path, nod: float = 0.0) -> Scene:
    """A scene whose dome nods by so many degrees for two frames."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.normal(size=(400, 400)).astype(np.float32), (0, 0), 4)
    texture = np.clip(128 + 20 * noise / noise.std(), 0, 255).astype(np.uint8)
    centre = np.tile([80.0, 80.0], (FRAMES, 1))
    t = np.arange(FRAMES)[:, None]
    turns = np.array([3.0, 6.0, 2.0]) * np.sin(t * [0.2, 0.35, 0.1])
    turns[10:12, 0] += nod
    truth = Poses(
        rotation_from_vector(np.deg2rad(turns)),
        [0.0, 0, 8] + np.array([0.1, 0.05, 0.1]) * np.sin(t * [0.1, 0.2, 0.15]),
    )
    films = [picture(texture, truth[k : k + 1], centre[k]) for k in range(FRAMES)]
    # The same scene, a third darker and flatter: gain and offset are free.
    films[5] = (films[5] * 0.6 + 20).astype(np.uint8)
    grid = np.stack(np.meshgrid(np.linspace(-0.6, 0.6, 40), np.linspace(-0.6, 0.6, 40)), -1)
    x, y = grid.reshape(-1, 2).T
    points = np.stack((x, y, dome(x, y)), axis=1)
    marks = points[::100]
    pixels = project(to_camera(truth, marks), FOCAL, centre)
    jitter = rng.normal(0, 0.4, (FRAMES, 1, 2))
    linked = np.ones(FRAMES, bool)
    linked[[0, -1]] = False
    start = Poses(truth.rotation, truth.translation.copy())
    start.translation[:, :2] += jitter[:, 0] * 8 / FOCAL
    strip = FaceStrip.record(
        folder / "strip.npy", films, project(to_camera(start, points), FOCAL, centre)
    )
    return Scene(
        truth,
        start,
        Skin(points, np.tile([0.0, 0, -1], (1600, 1))),
        marks,
        Observations(pixels + jitter, np.ones(FRAMES), linked, FOCAL, centre, 25.0),
        jitter,
        strip,
    )


def test_jittered_poses_are_pulled_back_onto_the_pixels(scene: Scene) -> None:
    every = np.arange(FRAMES)
    judged = scene.work(scene.skin.half(1))
    before = root_mean_square(residual_shift(scene.start, every, judged))
    work = scene.work(scene.skin.half(0))
    texture = texture_of(all_samples(scene.truth, every, work))
    poses = refine(scene.start, work, texture, scene.marks, scene.seen, lambda _: None)
    after = root_mean_square(residual_shift(poses, every, judged))
    # The score sees the jitter that was put in, but for its mean, and that it is gone.
    put_in = root_mean_square((scene.jitter - scene.jitter.mean(0))[:, 0])
    assert 0.7 * put_in < before < 1.3 * put_in
    assert after < 0.1
    error = project(to_camera(poses, scene.skin.points), FOCAL, scene.seen.centre) - project(
        to_camera(scene.truth, scene.skin.points), FOCAL, scene.seen.centre
    )
    # A shift of all frames together is not observable: the mean texture moves along.
    assert np.abs((error - error.mean(0)).mean(1)).max() < 0.15


def test_a_quick_nod_is_not_damped(tmp_path: Path) -> None:
    scene = filmed(tmp_path, nod=6.0)
    work = scene.work(scene.skin.half(0))
    texture = texture_of(all_samples(scene.truth, np.arange(FRAMES), work))
    poses = refine(scene.start, work, texture, scene.marks, scene.seen, lambda _: None)
    # A frame's pose against its neighbours': where all of them are is not observable.
    nods = [
        Rotation.from_matrix(p.rotation[10] @ p.rotation[9].T).magnitude()
        for p in (poses, scene.truth)
    ]
    assert nods[0] / nods[1] == pytest.approx(1, abs=0.1)


def test_skin_of_the_wrong_relief_is_bent_right(scene: Scene) -> None:
    x, y = scene.skin.points[:, :2].T
    # The dome drawn as if it were bent to a saddle, along the rays of the first frame's camera.
    wrong = 0.15 * (x**2 - y**2)
    view = scene.truth[:1]
    relief = Relief.flat(scene.skin, view)
    drawn = Skin(scene.skin.points + relief.rays(scene.skin) * wrong[:, None], scene.skin.normals)
    found, _ = solve_relief(
        scene.start, scene.work(drawn), scene.marks, scene.seen, view, lambda _: None
    )
    bent = found.bend(drawn).points
    left = bent[:, 2] - dome(bent[:, 0], bent[:, 1])
    plane = np.stack((x, y, np.ones_like(x)), axis=1)
    left = left - plane @ np.linalg.lstsq(plane, left, rcond=None)[0]
    assert left.std() < 0.5 * wrong.std()
