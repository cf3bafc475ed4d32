"""Photometric refinement on a textured surface seen by a known camera."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses, project, rotation_from_vector, to_camera
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.photometric import Alignment
from dubbing.preparation.alignment.refinement import jacobian_of, product, refine
from dubbing.preparation.alignment.relief import Relief, solve_relief
from dubbing.preparation.alignment.score import residual_shift, root_mean_square
from dubbing.preparation.alignment.skin import Skin
from dubbing.preparation.alignment.texture import Texture, median_of_known, texture_of

pytestmark = pytest.mark.medium


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
        folder / "strip.npy", np.stack(films), project(to_camera(start, points), FOCAL, centre)
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
    texture = texture_of(scene.truth, every, work)
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
    texture = texture_of(scene.truth, np.arange(FRAMES), work)
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


def test_a_grey_value_changes_as_the_step_and_the_relief_move_its_point() -> None:
    """A plane whose grey value rises by `slope` along it: what a moved point meets of it."""
    normal, slope = np.array([0.0, 0, -1]), np.array([3.0, -5.0, 0])
    points = np.array([[0.3, 0.2, 0], [-0.4, 0.1, 0], [0.1, -0.5, 0]])
    pose = Poses(rotation_from_vector(np.array([[0.1, -0.3, 0.2]])), np.array([[0.2, 0.1, 8.0]]))
    rays, basis = np.array([[0.1, 0.2, 1.0]] * 3), np.array([[1.0], [0.5], [2.0]])
    nothing = FaceStrip(np.zeros((1, 8, 8), np.uint8), np.zeros((1, 2), int))
    work = Alignment(Skin(points, np.tile(normal, (3, 1))), nothing, FOCAL, np.zeros((1, 2)))
    texture = Texture(points @ slope, np.ones(3), np.tile(slope, (3, 1)))
    view = work.view(pose, np.array([0]))
    jacobian = jacobian_of(view, texture, (rays, basis))[0]

    def met(step: np.ndarray) -> np.ndarray:
        moved = to_camera(pose.stepped(step[None, :6]), points + rays * basis * step[6])[0]
        # Back into the unmoved head, and along the camera's ray to its plane z = 0.
        eye = -pose.translation[0] @ pose.rotation[0]
        ray = moved @ pose.rotation[0]
        return (eye - ray * (eye[2] / ray[:, 2:])) @ slope

    numeric = [(met(1e-5 * unit) - met(-1e-5 * unit)) / 2e-5 for unit in np.eye(7)]
    np.testing.assert_allclose(jacobian, np.stack(numeric, 1), atol=1e-4)


@pytest.mark.parametrize("slope", [0.0, 5.0])
def test_a_point_that_is_seen_edge_on_says_nothing(slope: float) -> None:
    points, normals = np.array([[0.0, 0.1, 0], [0.0, 0.2, 0]]), np.array([[1.0, 0, 0], [0, 0, -1]])
    pose = Poses(np.eye(3)[None], np.array([[0.0, 0, 8]]))
    nothing = FaceStrip(np.zeros((1, 8, 8), np.uint8), np.zeros((1, 2), int))
    view = Alignment(Skin(points, normals), nothing, FOCAL, np.zeros((1, 2))).view(
        pose, np.array([0])
    )
    texture = Texture(np.zeros(2), np.ones(2), np.array([[slope, slope, 0], [1, 1, 0]]))
    jacobian = jacobian_of(view, texture, None)[0]
    assert not jacobian[0].any()
    assert np.isfinite(jacobian).all()
    assert jacobian[1].any()


def test_pictures_are_read_between_their_pixels() -> None:
    rng = np.random.default_rng(0)
    pictures = rng.integers(0, 255, (3, 9, 12), np.uint8)
    strip = FaceStrip(pictures, np.array([[4, 2], [0, 0], [1, 7]]))
    frames, pixels = np.array([2, 0]), rng.uniform(0, 16, (2, 40, 2)).astype(np.float32)
    pixels[1, 0] = [6.5, 4.25]  # in the picture of frame 0 at column 2.5, row 2.25
    values, slopes = strip.sample(frames, pixels), strip.slopes(frames, pixels)
    grey = pictures[0].astype(float)
    target = 0.75 * (grey[2, 2] + grey[2, 3]) / 2 + 0.25 * (grey[3, 2] + grey[3, 3]) / 2
    assert values[1, 0] == pytest.approx(target)
    steps = [(grey[row, 3:5] - grey[row, 1:3]).mean() / 2 for row in (2, 3)]
    assert slopes[1, 0, 0] == pytest.approx(0.75 * steps[0] + 0.25 * steps[1])
    for k, frame in enumerate(frames):
        for value, (x, y) in zip(values[k], pixels[k] - strip.corner[frame], strict=True):
            column, row = int(np.floor(x)), int(np.floor(y))
            inside = 0 <= column < 11 and 0 <= row < 8
            assert np.isfinite(value) == inside
            if inside:
                four = pictures[frame, row : row + 2, column : column + 2].astype(float)
                across = np.array([1 - x + column, x - column])
                assert value == pytest.approx(np.array([1 - y + row, y - row]) @ four @ across)


def test_median_of_what_is_known() -> None:
    values = np.random.default_rng(0).normal(size=(9, 50))
    values[np.random.default_rng(1).random((9, 50)) < 0.4] = np.nan
    values[0] = 0.5
    np.testing.assert_array_equal(median_of_known(values), np.nanmedian(values, axis=0))


def test_a_product_of_many_points_is_the_sum_of_its_parts() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 60, 301)), rng.normal(size=(2, 301, 61))
    np.testing.assert_allclose(product(one, other), one @ other, rtol=1e-9, atol=1e-9)
