"""Frames in which the head is turned further than in the learned seconds are learned from too."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.identity.clip_frames import APART, FURTHER, MOST, ClipFrames, with_turned
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from tests import clips
from tests.fakes import write_prepared

FRAMES = 200
LEARNED = np.arange(50)


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    clips.write_video(tmp_path / "clip.mp4", FRAMES)
    return write_prepared(tmp_path / "clip.mp4", tmp_path)


def turned(clip: PreparedClip, yaw: np.ndarray) -> ClipFrames:
    """The first frames of a clip whose head turns by these degrees."""
    rotation = Rotation.from_euler("y", yaw[:, None], degrees=True).as_matrix()
    speech = SpeechFrames(
        np.zeros((FRAMES, 16, 4), np.float32), np.zeros((FRAMES, NUMBERS), np.float32)
    )
    return ClipFrames(replace(clip, rotation=rotation), speech, LEARNED)


def test_what_is_turned_further_is_learned_once(clip: PreparedClip) -> None:
    yaw = np.zeros(FRAMES)
    yaw[60:160] = np.repeat(np.linspace(0, 45, 50), 2)
    footage = turned(clip, yaw)
    covered = (yaw > 19.5) & (yaw < 25.5)
    (one,) = with_turned([replace(footage, clip=replace(footage.clip, covered=covered))])
    assert set(one.frames) >= set(LEARNED)
    chosen = np.deg2rad(yaw[np.setdiff1d(one.frames, LEARNED)])
    assert 0.5 < len(chosen) * APART / (np.deg2rad(45 - 6) - FURTHER) < 1.0
    assert chosen.min() > FURTHER
    assert chosen.max() == pytest.approx(np.deg2rad(45))
    assert np.diff(np.sort(chosen)).min() > APART
    assert not covered[one.frames].any()


def test_a_head_that_stays_as_it_was_learned_adds_nothing(clip: PreparedClip) -> None:
    (one,) = with_turned([turned(clip, np.linspace(0, np.rad2deg(FURTHER) - 1, FRAMES))])
    assert one.frames.tolist() == LEARNED.tolist()


def test_of_many_the_most_different_are_taken_from_all_clips(clip: PreparedClip) -> None:
    left = turned(clip, np.concatenate([np.zeros(50), np.linspace(0, 90, 150)]))
    right = replace(turned(clip, np.linspace(-1, -90, FRAMES)), frames=LEARNED[:0])
    found = with_turned([left, right])
    more = [np.setdiff1d(found[0].frames, LEARNED), found[1].frames]
    assert sum(map(len, more)) == MOST
    assert abs(len(more[0]) - len(more[1])) < 6
    assert all(FRAMES - 1 in frames for frames in more)


def test_without_a_learned_face_nothing_is_compared(clip: PreparedClip) -> None:
    nothing = replace(turned(clip, np.linspace(0, 90, FRAMES)), frames=LEARNED[:0])
    assert not len(with_turned([nothing])[0].frames)
