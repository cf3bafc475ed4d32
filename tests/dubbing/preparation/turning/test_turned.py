"""Poses of heads that are turned far, on the synthetic speaker, whose poses are known."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import soundfile
from scipy.spatial.transform import Rotation

from dubbing.face.mouth.lip_measures import lip_lengths
from dubbing.media import VideoWriter, mux
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.prepare import prepare
from dubbing.preparation.turning.turned import ANCHORS, AT_ONCE, FEWEST, frontal, parts_of
from dubbing.workshop.synthetic.anatomy.face import face_by_name
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep
from dubbing.workshop.synthetic.motion import move
from dubbing.workshop.synthetic.rendering.render import REST_SHIFT, Renderer, State
from dubbing.workshop.synthetic.visemes import mouth_curves
from dubbing.workshop.true_dubs.rendered import speech

TURN, FRAMES, SIZE = 80.0, 96, 256


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


@pytest.mark.slow
def test_a_head_that_speaks_is_followed_into_profile_and_back(tmp_path: Path) -> None:
    """Beyond 72 degrees no landmark says what lips do; here for two dozen frames."""
    rate, said = Fraction(25), speech("learned")
    curves = mouth_curves(said.phones, FRAMES, rate)
    held = smoothstep(26, 40, np.arange(FRAMES)) - smoothstep(72, 84, np.arange(FRAMES))
    motion = move(
        FRAMES,
        rate,
        seed=3,
        rest=REST_SHIFT,
        opening=curves[:, 0],
        amount=1.0,
        turns=np.stack([0 * held, TURN * held], 1),
    )
    renderer, opening = Renderer(face_by_name("alba"), SIZE), np.zeros(FRAMES)
    silent, sound = tmp_path / "silent.mkv", tmp_path / "sound.wav"
    with VideoWriter(silent, SIZE, SIZE, rate, "ffv1") as video:
        for t, (pose, curve) in enumerate(zip(motion.poses, curves, strict=True)):
            shot = renderer.render(State(pose, MouthShape(*curve)))
            opening[t] = shot.opening
            video.write(shot.image)
    soundfile.write(sound, said.sound, said.rate)
    film = tmp_path / "film.mkv"
    mux(silent, sound, film, audio_start=0.0, seconds=FRAMES / 25, audio_codec="flac")
    clip = prepare(film, tmp_path / "prepared", size=SIZE)
    assert clip.valid.all()
    assert clip.detected.all()
    true = np.stack([pose.rotation for pose in motion.poses])
    # The head frames differ by a turn that is the same in all frames.
    apart = true.transpose(0, 2, 1) @ clip.rotation
    turn = np.degrees(np.arccos(true[:, 2, 2].clip(-1, 1)))
    fixed = Rotation.from_matrix(apart[turn < 12]).mean().as_matrix()
    left = Rotation.from_matrix(true @ fixed @ clip.rotation.transpose(0, 2, 1))
    error = np.degrees(left.magnitude())
    assert error[turn < 15].max() < 2
    assert np.sqrt(np.square(error[turn > 45]).mean()) < 5
    lips = lip_lengths(clip.frontal_landmarks())[:, 0]
    side = turn > 70
    assert side.sum() > 20
    assert np.corrcoef(lips[side], opening[side])[0, 1] > 0.8
