"""Faces that stay the film's own: none seen, covered, or turned from what was learned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.prepared import PreparedClip
from dubbing.video import own_pixels as module
from dubbing.video.own_pixels import learned_views, own_pixels, reach, reasons, views
from tests import clips, fakes

# Degrees of each frame's turn about the vertical, then nods of ten and thirty degrees.
YAW = [-45, -21, -19, 0, 3, 19, 21, 45, 0, 0]
NOD = [0, 0, 0, 0, 0, 0, 0, 0, 10, 30]
LEARNED = [(3 / 25, 4 / 25)]  # the frame that looks straight ahead


@pytest.fixture(autouse=True)
def farthest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FARTHEST_VIEW", 20.0)


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    film = clips.write_video(tmp_path / "film.mkv", len(YAW), codec="ffv1")
    made = fakes.write_prepared(film, tmp_path)
    turns = Rotation.from_euler("yx", np.stack([YAW, NOD], 1), degrees=True)
    return replace(made, rotation=turns.as_matrix())


def test_a_frame_turned_further_than_was_learned_keeps_its_face(clip: PreparedClip) -> None:
    found = reasons(clip, learned_views(clip, LEARNED))
    assert found.tolist() == [3, 3, 0, 0, 0, 0, 3, 3, 0, 3]
    # What is near any of the learned views is rendered.
    both = learned_views(clip, [*LEARNED, (7 / 25, 8 / 25)])
    assert reasons(clip, both).tolist() == [3, 3, 0, 0, 0, 0, 3, 0, 0, 3]


def test_a_profile_without_landmarks_keeps_its_face(clip: PreparedClip) -> None:
    turns = Rotation.from_euler("y", np.linspace(0, 90, len(clip))[:, None], degrees=True)
    detected = np.arange(len(clip)) % 3 > 0
    profile = replace(clip, rotation=turns.as_matrix(), detected=detected)
    found = reasons(profile, views(profile))
    assert found.tolist() == [0, 0, 0, 0, 0, 0, 0, 0, 0, 3]  # 60 degrees are no profile yet
    assert not reasons(replace(profile, detected=detected | True), views(profile)).any()


def test_the_first_reason_is_the_one_that_is_given(clip: PreparedClip) -> None:
    flags = np.zeros((2, len(clip)), bool)
    flags[0, [0, 4]] = flags[1, [0, 1, 5]] = True
    hidden = replace(clip, valid=~flags[0], covered=flags[1])
    found = reasons(hidden, learned_views(hidden, LEARNED))
    assert found.tolist() == [1, 2, 0, 0, 1, 2, 3, 3, 0, 3]


def test_a_view_points_from_the_head_to_the_camera(clip: PreparedClip) -> None:
    """The head frame moves with the head: what it sees turns the other way."""
    seen = views(clip)
    np.testing.assert_allclose(seen[3], [0, 0, -1], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(np.arctan2(seen[:8, 0], -seen[:8, 2])), YAW[:8])
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), 1)


def test_views_are_learned_from_the_seconds_that_show_a_face(clip: PreparedClip) -> None:
    detected = np.ones(len(clip), bool)
    detected[6] = False
    found = learned_views(replace(clip, detected=detected), [(0.0, 0.08), (0.2, 0.32)])
    np.testing.assert_allclose(found, views(clip)[[0, 1, 5, 7]])


def test_runs_are_counted_from_the_first_frame_of_the_cue() -> None:
    found = own_pixels("ann", 100, np.array([3, 3, 0, 1, 2, 2, 0]))
    assert [(run["reason"], run["first"], run["stop"]) for run in found] == [
        ("turned", 100, 102),
        ("no face", 103, 104),
        ("covered", 104, 106),
    ]
    assert {run["cue"] for run in found} == {"ann"}
    assert own_pixels("ann", 0, np.zeros(3, int)) == []


def test_the_reach_is_of_the_frames_under_a_dub(clip: PreparedClip) -> None:
    kept = np.array([3, 3, 0, 0, 0, 0, 3, 3, 0, 3])
    frames = np.array([0, 1, 2, 3, 3, 3])
    found = reach(clip, frames, kept[frames])
    assert (found.frames, found.dubbed, found.reasons) == (6, 4, {"turned": 2})
    assert found.yaw is not None
    assert found.yaw.most == pytest.approx(-YAW[0])
    # Before anybody is learned nothing is known to be turned too far.
    valid = np.arange(len(clip)) != 4
    assert reach(replace(clip, valid=valid)).reasons == {"no face": 1}
