"""The best seconds of a clip are those in which the person talks, is seen sharply, and turns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dfrf.field.speaker_adaptation import NUMBERS
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.identity import best_seconds
from dubbing.identity.best_seconds import best_frames, choose_frames, parts_of, pieces
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames
from tests import clips
from tests.dubbing.sync.meshes import talk
from tests.fakes import write_prepared

RATE, PIECE, FRAMES = 25, 75, 300  # four pieces of 3 s


def heard(voiced: slice) -> SpeechFrames:
    """Speech that changes in some frames and is silent in all others."""
    windows = np.zeros((FRAMES, 16, 4), np.float32)
    windows[voiced] = np.random.default_rng(1).normal(size=windows[voiced].shape)
    return SpeechFrames(windows, np.zeros((FRAMES, NUMBERS), np.float32))


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PreparedClip:
    """A face that is frozen and silent for 6 s and then talks for 6 s, equally sharp throughout."""
    clips.write_video(tmp_path / "clip.mp4", FRAMES)
    found = write_prepared(tmp_path / "clip.mp4", tmp_path)
    marks = np.repeat(talk(np.zeros(1)), FRAMES, 0)[..., :2] * 10
    marks[FRAMES // 2 :] = talk(0.1 * np.random.default_rng(0).random(FRAMES // 2))[..., :2] * 10
    assert (marks[:, LEFT_EYE_OUTER] != marks[:, RIGHT_EYE_OUTER]).any()
    monkeypatch.setattr(best_seconds, "eye_energy", lambda clip: np.ones(FRAMES))
    return replace(found, landmarks=marks)


TALKS = slice(FRAMES // 2, FRAMES)


def test_of_a_silent_and_a_talking_half_the_talking_one_is_learned(clip: PreparedClip) -> None:
    chosen = best_frames([clip], [heard(TALKS)], FRAMES // 2)[0]
    assert chosen.tolist() == list(range(FRAMES // 2, FRAMES))
    assert taken(clip, None, 6.0) == chosen.tolist()
    assert taken(clip, 1.0, 2.0) == list(range(25, 75))
    assert taken(clip, 11.0, 2.0) == list(range(275, 300))


def taken(clip: PreparedClip, start: float | None, seconds: float) -> list[int]:
    (footage,) = choose_frames([clip], [heard(TALKS)], start, seconds)
    return list(footage.frames)


def test_what_one_clip_lacks_the_next_gives(clip: PreparedClip) -> None:
    speech = heard(TALKS)
    footage = choose_frames([clip, clip, clip], [speech] * 3, 2.0, 15.0)
    assert [one.frames.tolist() for one in footage] == [
        list(range(50, 300)),
        list(range(50, 175)),
        [],
    ]


def test_the_best_seconds_are_looked_for_in_all_clips(clip: PreparedClip) -> None:
    silent = heard(slice(0, 0))
    frozen = replace(clip, landmarks=clip.landmarks[np.zeros(FRAMES, int)])
    first, second = best_frames([frozen, clip], [silent, heard(TALKS)], FRAMES // 2)
    assert not len(first)
    assert second.tolist() == list(range(FRAMES // 2, FRAMES))
    everything = best_frames([frozen, clip], [silent, silent], 2 * FRAMES)
    assert [len(one) for one in everything] == [FRAMES, FRAMES]


def test_what_is_blurred_covered_or_seen_as_before_is_left(
    clip: PreparedClip, monkeypatch: pytest.MonkeyPatch
) -> None:
    everywhere = heard(slice(0, FRAMES))
    talking = replace(clip, landmarks=clip.landmarks[np.arange(FRAMES) % PIECE + 2 * PIECE])
    covered = talking.detected.copy()
    covered[PIECE : 2 * PIECE : 2] = False
    sharp = np.ones(FRAMES)
    sharp[: 3 * PIECE // 4] = 0.1
    monkeypatch.setattr(best_seconds, "eye_energy", lambda clip: sharp)
    clear = best_frames([replace(talking, detected=covered)], [everywhere], 2 * PIECE)[0]
    assert parts_of(clear) == [(2 * PIECE, 2 * PIECE)]
    # Two pieces of a head that looks ahead, and two of one that looks aside: one of each.
    monkeypatch.setattr(best_seconds, "eye_energy", lambda clip: np.ones(FRAMES))
    turn = np.radians(20)
    rotation = talking.rotation.copy()
    rotation[: TALKS.start] = [
        [np.cos(turn), 0, np.sin(turn)],
        [0, 1, 0],
        [-np.sin(turn), 0, np.cos(turn)],
    ]
    both = best_frames([replace(talking, rotation=rotation)], [everywhere], 2 * PIECE)[0]
    assert len(both) == 2 * PIECE
    assert (both < TALKS.start).sum() == PIECE


def test_pieces_end_at_cuts_and_the_choice_is_as_long_as_asked_for(clip: PreparedClip) -> None:
    cut = replace(clip, segment=(np.arange(FRAMES) >= 100).astype(int))
    assert [(int(p[0]), len(p)) for p in pieces(cut)] == [(0, 100), (100, 67), (167, 67), (234, 66)]
    for count in (1, 80, 299):
        chosen = best_frames([cut], [heard(TALKS)], count)[0]
        assert len(chosen) == len(set(chosen.tolist())) == count
        assert (np.diff(chosen) > 0).all()
    assert best_frames([cut], [heard(TALKS)], FRAMES + 1)[0].tolist() == list(range(FRAMES))


def test_sharpness_is_that_of_the_eyes(tmp_path: Path) -> None:
    clips.write_video(tmp_path / "clip.mkv", 3, codec="ffv1")
    found = write_prepared(tmp_path / "clip.mkv", tmp_path, invalid=(1,))
    marks = np.random.default_rng(0).uniform(4, 28, (3, 478, 2))
    energy = best_seconds.eye_energy(replace(found, landmarks=marks))
    assert (energy > 0).tolist() == [True, False, True]
