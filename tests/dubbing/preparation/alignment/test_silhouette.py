"""The outline of a head: measured on drawn heads, and what it does to turns."""

import cv2
import numpy as np
import pytest

from dubbing.face.eyes import eye_axes, upwards
from dubbing.preparation.alignment.banded import DOF
from dubbing.preparation.alignment.camera import Poses, project, rotation_from_vector, to_camera
from dubbing.preparation.alignment.silhouette import (
    NOD,
    TURN,
    Silhouette,
    equations,
    measure,
    places,
)

# Corners of the eyes in the head frame (y down), in the order of `mesh_points.EYE_CORNERS`.
CORNERS = np.array([[-0.45, 0, -0.8], [-0.16, 0, -0.85], [0.16, 0, -0.85], [0.45, 0, -0.8]])
FOCAL, CENTRE = 1200.0, np.array([256.0, 256.0])


def drawn(shift: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """An ellipse of 90 by 130 px about (256 + x, 240 + y), (512, 512) float32 in 0..1."""
    picture = np.zeros((512, 512), np.uint8)
    middle = (round((256 + shift[0]) * 16), round((240 + shift[1]) * 16))
    cv2.ellipse(picture, middle, (90 * 16, 130 * 16), 0, 0, 360, 255, -1, cv2.LINE_AA, 4)
    return picture.astype(np.float32) / 255


def eyes(tilt: float = 0.0) -> np.ndarray:
    """Corners (4, 2) px on a line through (256, 250)."""
    angle = np.deg2rad(tilt)
    right = np.array([np.cos(angle), np.sin(angle)])
    return np.array([256, 250]) + np.array([-60, -22, 22, 60])[:, None] * right


def test_middle_and_top_follow_the_head_to_a_part_of_a_pixel() -> None:
    middle, top = measure(drawn(), eyes())
    moved, _ = measure(drawn(shift=(3.25, 0.0)), eyes())
    _, higher = measure(drawn(shift=(0.0, -5.5)), eyes())
    np.testing.assert_allclose(middle, [256, 250], atol=0.6)
    # The median over places up to 42 px beside the middle, where the top is at 110.
    np.testing.assert_allclose(top[1], 114, atol=1)
    np.testing.assert_allclose((moved - middle)[0], 3.25, atol=0.1)
    np.testing.assert_allclose((higher - top)[1], -5.5, atol=0.3)


def test_a_tilted_head_is_measured_along_its_eyes() -> None:
    tilt = 12.0
    upright = measure(drawn(shift=(4.0, 0.0)), eyes())
    # The same picture, turned about the middle of the eyes.
    turn = cv2.getRotationMatrix2D((256.0, 250.0), -tilt, 1)
    tilted = measure(cv2.warpAffine(drawn(shift=(4.0, 0.0)), turn, (512, 512)), eyes(tilt))
    for one, other in zip(upright, tilted, strict=True):
        np.testing.assert_allclose(turn @ [*one, 1], other, atol=0.5)


def test_what_the_picture_cuts_off_is_not_known() -> None:
    middle, top = measure(np.roll(drawn(), -115, axis=0), eyes() - np.array([0, 115]))
    assert np.isfinite(middle).all()
    assert np.isnan(top).all()
    middle, _ = measure(np.roll(drawn(), 180, axis=1), eyes() + np.array([180, 0]))
    assert np.isnan(middle).all()


def turning(count: int = 40) -> Poses:
    t = np.arange(count)[:, None]
    turns = np.deg2rad([4.0, 7.0, 3.0]) * np.sin(t * [0.3, 0.2, 0.25] + [0, 1, 2])
    return Poses(rotation_from_vector(turns), np.tile([0.05, -0.1, 8.0], (count, 1)))


def outline_of(poses: Poses) -> Silhouette:
    """Silhouettes that lie exactly on their lines."""
    middle, right, apart = eye_axes(project(to_camera(poses, CORNERS), FOCAL, CENTRE[None]))
    turn, nod = poses.rotation[:, 2, 0], poses.rotation[:, 2, 1]
    apart = apart / np.sqrt(1 - turn**2)
    return Silhouette(
        middle + right * ((TURN * turn + 0.03) * apart)[:, None],
        middle + upwards(right) * ((NOD * nod + 1.1) * apart)[:, None],
    )


def test_the_outline_of_a_ball_keeps_to_its_line_however_far_it_turns() -> None:
    """Seen from far away, a ball's middle is that of its outline, and its top is its radius up."""
    angles = np.deg2rad(np.linspace(-40, 40, 17))
    turned = rotation_from_vector(angles[:, None] * [0.0, 1.0, 0.0])
    poses = Poses(turned, np.tile([0.0, 0.0, 800.0], (17, 1)))
    focal = 100 * FOCAL
    eyes = np.array([[-0.45, 0, -0.8], [-0.16, 0, -0.8], [0.16, 0, -0.8], [0.45, 0, -0.8]])
    ball = project(to_camera(poses, np.zeros((1, 3))), focal, CENTRE[None])[:, 0]
    seen = Silhouette(ball, ball - [0, 1.2 * focal / 800])
    middle, top = places(seen, poses, eyes, focal, CENTRE[None])
    np.testing.assert_allclose(middle, -0.8 / 0.9 * poses.rotation[:, 2, 0], atol=2e-3)
    np.testing.assert_allclose(top, 1.2 / 0.9, atol=2e-3)


def test_turns_are_drawn_to_what_the_outline_shows() -> None:
    truth = turning()
    seen = outline_of(truth)
    # All turns and nods half as large again as they were.
    vectors = np.stack([cv2.Rodrigues(r)[0][:, 0] for r in truth.rotation])
    at = CORNERS.mean(0)
    held = truth.rotation @ at + truth.translation

    def about_the_eyes(rotation: np.ndarray) -> Poses:
        """Poses that leave the eyes where pixels hold them."""
        return Poses(rotation, held - rotation @ at)

    poses = about_the_eyes(rotation_from_vector(vectors * [1.5, 1.5, 1.0]))

    def wrong(now: Poses) -> np.ndarray:
        """Spread (2,) of the errors of turn and nod; a fixed angle is not observable."""
        return np.asarray((now.rotation[:, 2, :2] - truth.rotation[:, 2, :2]).std(0))

    before = wrong(poses)
    for _ in range(6):
        one = equations(seen, poses, CORNERS, FOCAL, CENTRE[None])
        assert not one.diagonal[:, 3:].any()
        held_back = one.diagonal + 1e-3 * np.eye(DOF)
        step = np.linalg.solve(held_back, one.right[..., None])[..., 0]
        poses = about_the_eyes(poses.stepped(step).rotation)
    assert (wrong(poses) < 0.05 * before).all()


def test_an_outline_that_is_seldom_seen_counts_for_nothing() -> None:
    poses = turning()
    seen = outline_of(poses)
    seen.middle[:25] = np.nan
    seen.top[:] = np.nan
    one = equations(seen, poses, CORNERS, FOCAL, CENTRE[None])
    assert not one.diagonal.any()
    assert not one.right.any()


def test_one_frame_in_which_something_else_is_seen_hardly_counts() -> None:
    poses = turning()
    seen = outline_of(poses)
    seen.middle[7] += [60, 0]
    right = equations(seen, poses, CORNERS, FOCAL, CENTRE[None]).right
    linear = 60 / (0.9 * FOCAL / 8) / 0.006**2
    assert 0 < np.abs(right[7]).max() < 0.05 * linear
    np.testing.assert_allclose(np.delete(right, 7, 0), 0, atol=1e-3 * linear)


@pytest.mark.parametrize("count", [1, 5])
def test_frames_are_taken(count: int) -> None:
    seen = outline_of(turning()).take(np.arange(count))
    assert seen.middle.shape == seen.top.shape == (count, 2)
