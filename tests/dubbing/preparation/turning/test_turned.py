"""Poses of heads that are turned far, on the synthetic speaker, whose poses are known."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.media import VideoWriter
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.prepare import prepare
from dubbing.preparation.turning import turned
from dubbing.preparation.turning.head_surface import HeadSurface
from dubbing.preparation.turning.point_tracks import PointTracks
from dubbing.preparation.turning.turned import (
    ANCHORS,
    AT_ONCE,
    FEWEST,
    Footage,
    follow_turned,
    frontal,
    parts_of,
)
from dubbing.workshop.synthetic.anatomy.face import face_by_name
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.motion import move
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State

TURN, FRAMES, SIZE = 75.0, 64, 256


def poses_of(yaw: np.ndarray) -> Poses:
    turn = Rotation.from_euler("Y", yaw[:, None], degrees=True).as_matrix()
    return Poses(turn, np.tile([0.0, 0.0, 9.0], (len(yaw), 1)))


def test_landmarks_of_a_turned_head_are_not_trusted() -> None:
    yaw = np.concatenate([np.zeros(FEWEST), [15.0, 30, 60, -50]])
    valid = np.ones(len(yaw), bool)
    valid[0] = False
    trusted = frontal(poses_of(yaw), valid, np.zeros(len(yaw), int))
    assert trusted.tolist() == [False] + [True] * FEWEST + [False] * 3


def test_a_shot_without_frontal_frames_has_nothing_better() -> None:
    yaw, segment = np.concatenate([np.zeros(20), np.full(20, 50.0)]), np.repeat([0, 1], 20)
    assert frontal(poses_of(yaw), np.ones(40, bool), segment).all()


def test_long_runs_are_solved_in_parts_that_overlap() -> None:
    count = 3 * AT_ONCE
    parts = parts_of(ANCHORS, count, count)
    assert parts[0].start == 0
    assert parts[-1].stop == count
    for one, other in pairwise(parts):
        assert one.stop - other.start == 2 * ANCHORS


def test_a_head_that_is_lost_stays_where_it_was_last_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """It does not go on as it moved: a few frames later it would be behind the camera."""
    count, trusted, lost = 90, 12, 30
    rng = np.random.default_rng(0)
    places = rng.uniform(-0.7, 0.7, (60, 3))
    near = 9 - 0.2 * np.arange(count)
    true = Poses(np.tile(np.eye(3), (count, 1, 1)), np.stack([0 * near, 0 * near, near], 1))
    point, frame = np.tile(np.arange(60), lost), np.repeat(np.arange(lost), 60)
    in_camera = places[point] + true.translation[frame]
    tracks = PointTracks(point, frame, 600 * in_camera[:, :2] / in_camera[:, 2:] + 128, places)
    monkeypatch.setattr(turned, "follow", lambda *given: tracks)
    blank, centre = np.zeros((count, 1, 1, 3), np.uint8), np.full((count, 2), 128.0)
    surface = HeadSurface(np.zeros((478, 3)), 600.0)
    footage = Footage(blank, blank[..., 0], centre, np.zeros(count, int), surface)
    start = true[np.arange(count).clip(0, trusted - 1)]
    found, known = follow_turned(start, np.arange(count) < trusted, footage)
    assert known.tolist() == [t < lost for t in range(count)]
    np.testing.assert_allclose(found.translation[:lost, 2], near[:lost], atol=0.05)
    np.testing.assert_array_equal(
        found.translation[lost:], found.translation[[lost - 1]].repeat(count - lost, 0)
    )


@pytest.mark.slow
def test_a_head_is_followed_into_profile_and_back(tmp_path: Path) -> None:
    """No landmark is found beyond 75 degrees; here it is lost for a dozen frames."""
    rate = Fraction(25)
    wave = np.sin(np.pi * np.clip((np.arange(FRAMES) - 16) / (FRAMES - 24), 0, 1)) ** 2
    motion = move(
        FRAMES,
        rate,
        seed=3,
        rest=REST_SHIFT,
        opening=np.zeros(FRAMES),
        amount=1.0,
        turns=np.stack([0 * wave, TURN * wave], 1),
    )
    renderer = Renderer(face_by_name("alba"), SIZE)
    with VideoWriter(tmp_path / "film.mkv", SIZE, SIZE, rate, "ffv1") as video:
        for pose in motion.poses:
            video.write(renderer.render(State(pose, MouthShape())).image)
    clip = prepare(tmp_path / "film.mkv", tmp_path / "prepared", size=SIZE)
    assert clip.valid.all()
    true = np.stack([pose.rotation for pose in motion.poses])
    # The head frames differ by a turn that is the same in all frames.
    apart = true.transpose(0, 2, 1) @ clip.rotation
    turn = np.degrees(np.arccos(true[:, 2, 2].clip(-1, 1)))
    fixed = Rotation.from_matrix(apart[turn < 12]).mean().as_matrix()
    left = Rotation.from_matrix(true @ fixed @ clip.rotation.transpose(0, 2, 1))
    error = np.degrees(left.magnitude())
    assert error[turn < 15].max() < 2
    assert np.sqrt(np.square(error[turn > 45]).mean()) < 5
