"""Poses of a clip, refined with the head that is in it."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from dfrf import presets
from dfrf.cameras import Camera
from dfrf.fast.fast_model import FastModel
from dfrf.published.conditioned_field import PaperConfig
from dfrf.rendering.frame_renderer import render_frame
from dfrf.rendering.pose_refinement import moved
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.heads.pose_refinement import (
    RAYS,
    between,
    chosen_pixels,
    key_frames,
    refined,
    smoothest,
    trust,
)
from dubbing.media import VideoWriter
from dubbing.preparation.prepared import BACKGROUND, MATTE, PreparedClip
from tests.dfrf.people import FOCAL, SIZE, random_model, small_config
from tests.fakes import write_prepared

pytestmark = pytest.mark.medium


GREY = 90
RATE = Fraction(25)


def landmarks() -> np.ndarray:
    """Eyes at row 20, the base of the nose at row 30, the face a circle about the middle."""
    points = np.full((478, 2), 24.0)
    angle = np.linspace(0, 2 * np.pi, len(FACE_OVAL), endpoint=False)
    points[list(FACE_OVAL)] = 24 + 10 * np.stack([np.cos(angle), np.sin(angle)], -1)
    points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER, NOSE_BASE]] = (16, 20), (32, 20), (24, 30)
    return points


def filmed(model: FastModel, folder: Path, count: int) -> PreparedClip:
    """A prepared clip of a model of references 0, with the poses it was rendered at."""
    fill = np.full((SIZE, SIZE, 3), GREY, np.uint8)
    c2w = torch.eye(3, 4).repeat(count, 1, 1)
    c2w[:, 0, 3] = torch.linspace(-0.4, 0.4, count)
    c2w[:, 2, 3] = 7.0
    centre = torch.full((2,), (SIZE - 1) / 2)
    (folder / "prepared").mkdir()
    with VideoWriter(folder / "clip.mkv", SIZE, SIZE, RATE, "ffv1") as video:
        for _ in range(count):
            video.write(fill)
    clip = write_prepared(folder / "clip.mkv", folder / "prepared", size=SIZE)
    with (
        VideoWriter(folder / "clip.mkv", SIZE, SIZE, RATE, "ffv1") as video,
        VideoWriter(folder / "prepared" / MATTE, SIZE, SIZE, RATE, "ffv1-gray") as mattes,
        VideoWriter(folder / "prepared" / BACKGROUND, SIZE, SIZE, RATE, "ffv1") as fills,
    ):
        for camera in c2w:
            volume = model.volume(torch.zeros(1, 70), None)
            colour, opacity = render_frame(volume, Camera(camera, FOCAL, centre, SIZE))
            picture = colour + (1 - opacity[..., None]) * GREY / 255
            video.write((picture * 255).round().to(torch.uint8).numpy())
            mattes.write((opacity * 255).round().to(torch.uint8).numpy())
            fills.write(fill)
    return replace(
        clip.with_poses(c2w.double().numpy()),
        focal=FOCAL,
        centre=np.tile(centre.double().numpy(), (count, 1)),
        crop=np.tile([0.0, 0.0, SIZE, 0.0], (count, 1)),
        landmarks=np.tile(landmarks(), (count, 1, 1)),
        segment=np.repeat([0, 1], [count - 4, 4]),
    )


def test_poses_go_to_where_the_head_was_filmed(tmp_path: Path) -> None:
    torch.manual_seed(4)  # one of the random heads that the camera sees well enough
    model = presets.build(small_config(references=0, use_warp=False)).eval()
    clip = filmed(model, tmp_path, 16)
    true = clip.c2w()
    wrong = np.tile([0.01, -0.02, 0.0, 0.02, -0.02, 0.0], (16, 1))
    wrong[:, 2] = np.linspace(0, 0.02, 16)
    tracked = clip.with_poses(moved(torch.from_numpy(true), torch.from_numpy(wrong)).numpy())
    tracked.valid[5] = False
    found = refined(model, None, tracked, np.arange(12)).c2w()
    points = np.array([[0.6, 0.3, 0.5], [-0.6, 0.3, 0.5], [0.0, 1.0, 0.3]])

    def off(c2w: np.ndarray) -> np.ndarray:
        # By how many pixels points of the head land elsewhere, (16,).
        def seen(c2w: np.ndarray) -> np.ndarray:
            local = (points - c2w[:, None, :, 3]) @ c2w[:, :, :3]
            return FOCAL * local[..., :2] / local[..., 2:]

        return np.linalg.norm(seen(c2w) - seen(true), axis=-1).mean(1)

    before, after = off(tracked.c2w()), off(found)
    assert before.min() > 0.25
    # Also in the frame without a face.
    assert (after[:12] < 0.45 * before[:12]).all()
    # Those not asked for stay.
    np.testing.assert_allclose(after[12:], before[12:], rtol=1e-4)
    some = off(refined(model, None, tracked, np.arange(5)).c2w())
    assert (some[:5] < 0.45 * before[:5]).all()
    np.testing.assert_allclose(some[5:], before[5:], rtol=1e-4)
    tracked.valid[:] = False
    np.testing.assert_allclose(
        refined(model, None, tracked, np.arange(12)).c2w(), tracked.c2w(), atol=1e-5
    )


def test_a_clip_seen_by_its_own_cameras_is_the_same(tmp_path: Path) -> None:
    model = presets.build(small_config(references=0, use_warp=False)).eval()
    clip = filmed(model, tmp_path, 6)
    again = clip.with_poses(clip.c2w())
    np.testing.assert_allclose(again.rotation, clip.rotation, atol=1e-9)
    np.testing.assert_allclose(again.translation, clip.translation, atol=1e-9)


def test_the_published_model_keeps_the_poses_it_is_given(tmp_path: Path) -> None:
    model = presets.build(small_config(references=0, use_warp=False)).eval()
    clip = filmed(model, tmp_path, 6)
    published = presets.build(PaperConfig())
    assert refined(published, None, clip, np.arange(6)) is clip


def test_pixels_lie_above_the_base_of_the_nose_and_most_of_them_on_the_face() -> None:
    matte = np.zeros((SIZE, SIZE), np.uint8)
    matte[8:44, 8:40] = 255
    pixels = chosen_pixels(matte, landmarks(), np.random.default_rng(0))
    assert pixels.shape == (RAYS, 2)
    assert pixels[:, 1].max() < 30
    assert pixels[:, 1].min() == 7  # a little beyond the matte, too
    face = np.hypot(*(pixels - 24).T) < 10
    assert 0.6 < face.mean() < 0.75
    nothing = chosen_pixels(np.zeros_like(matte), landmarks(), np.random.default_rng(0))
    assert nothing.shape == (0, 2)


def test_corrections_bend_no_more_than_they_must() -> None:
    size = np.zeros((9, 6))
    size[:, 1] = np.linspace(0, 0.01, 9)
    noisy = size.copy()
    noisy[4, 1] += 0.01
    sure = np.tile(1e6 * np.eye(6), (9, 1, 1))
    unsure = sure.copy()
    unsure[4] *= 1e-4
    np.testing.assert_allclose(
        smoothest(sure, np.einsum("kij,kj->ki", sure, size)), size, atol=1e-4
    )
    kept = smoothest(unsure, np.einsum("kij,kj->ki", unsure, noisy))
    assert abs(kept[4, 1] - size[4, 1]) < 0.2 * 0.01
    alone = smoothest(sure[:1], np.einsum("kij,kj->ki", sure[:1], size[8:]))
    np.testing.assert_allclose(alone, size[8:], atol=1e-4)


def test_between_keys_corrections_go_straight() -> None:
    values = np.stack([np.arange(6.0), np.arange(6.0) + 10])
    there = between(values, np.array([2, 7]), np.array([2, 4, 7]))
    np.testing.assert_allclose(there[1], np.arange(6.0) + 4)


def test_a_head_that_turns_fast_has_more_key_frames() -> None:
    seen = np.arange(10, 40)
    angle = np.zeros(30)
    angle[10:16] = 0.02 * np.arange(1, 7)  # frames 20 to 25 turn
    angle[16:] = angle[15]
    c, s, one = np.cos(angle), np.sin(angle), np.ones(30)
    rotation = np.zeros((30, 3, 3))
    rotation[:, 0, 0], rotation[:, 0, 1], rotation[:, 1, 0] = c, -s, s
    rotation[:, 1, 1], rotation[:, 2, 2] = c, one
    np.testing.assert_array_equal(key_frames(seen, rotation, 50, np.inf), [10, 39])
    keys = key_frames(seen, rotation, 8, 0.03)
    np.testing.assert_array_equal(keys, [10, 18, 20, 21, 22, 23, 24, 32, 39])
    np.testing.assert_array_equal(key_frames(seen, rotation, 50, 0.01)[1:8], np.arange(19, 26))
    gap = np.delete(seen, 12)  # frame 22 shows no face
    assert {21, 23} <= set(key_frames(gap, np.delete(rotation, 12, 0), 8, 0.03))
    np.testing.assert_array_equal(key_frames(seen[:1], rotation[:1], 8, 0.03), [10])


def test_a_head_does_not_know_itself_from_where_it_was_not_seen() -> None:
    _, maps = random_model()
    middle = maps.views.c2w[:, :, 3].mean(0)

    def trusted(degrees: float) -> float:
        turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        c2w = torch.zeros(1, 3, 4)
        c2w[0, :, 3] = torch.from_numpy(turn).float() @ middle
        return float(trust(c2w, maps))

    assert trusted(0) == 1
    assert 0 < trusted(16) < 1
    assert trusted(40) == 0
    assert trust(torch.zeros(4, 3, 4), None).tolist() == [1, 1, 1, 1]
