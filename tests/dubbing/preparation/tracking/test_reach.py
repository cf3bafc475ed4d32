"""The share of frames that is dubbed, the angles of the head, and the words for both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.tracking.reach import Angles, Reach, angles_of, hidden, reach_of, views_of

AHEAD = np.array([0.0, 0.0, -1.0])


def seen_from(yaw: list[float], pitch: list[float]) -> np.ndarray:
    """Views of heads that turn to the right of the picture, and look up, by some degrees."""
    # The picture's y points down, so a positive turn about it moves the nose to the left.
    turns = Rotation.from_euler("yx", np.stack([np.negative(yaw), np.negative(pitch)], 1), True)
    return views_of(turns.as_matrix(), np.tile([0.0, 0.0, 9.0], (len(yaw), 1)))


def reach(**changed: np.ndarray) -> Reach:
    """Of 40 frames: the head turns from 5 degrees left to 34 right, in the last to 80."""
    yaw = [float(k) for k in range(-5, 34)]
    frames: dict[str, Any] = {
        "views": seen_from([*yaw, 80.0], [3.0] * 40),
        "valid": np.ones(40, bool),
        "over": np.zeros(40, bool),
        "kept": np.zeros(40, int),
    }
    return reach_of(**(frames | changed))


def test_the_nose_points_where_the_angles_say() -> None:
    noses = Rotation.from_euler("yx", [[-40, 0], [0, -10]], degrees=True).apply(AHEAD)
    assert noses[0, 0] > 0.5  # to the right of the picture
    assert noses[1, 1] < -0.1  # up
    yaw, pitch = angles_of(seen_from([40, 0, -70], [0, 10, 0]))
    np.testing.assert_allclose(yaw, [40, 0, -70], atol=1e-9)
    np.testing.assert_allclose(pitch, [0, 10, 0], atol=1e-9)


def test_a_head_that_looks_at_the_camera_from_the_edge_is_not_turned() -> None:
    """Where it stands counts: what the camera sees of it is a face from the front."""
    turned = Rotation.from_euler("y", [[45]], degrees=True).as_matrix()
    yaw, _ = angles_of(views_of(turned, np.array([[5.0, 0.0, 5.0]])))
    assert yaw[0] == pytest.approx(0, abs=1e-9)


def test_frames_are_counted_by_their_reasons_and_angles_where_there_is_a_face() -> None:
    valid, over = np.ones(40, bool), np.zeros(40, bool)
    valid[39], over[[3, 10, 11]] = False, True
    covered = np.isin(np.arange(40), [3, 4, 39])
    kept = hidden(valid, covered)
    assert kept[[3, 4, 39]].tolist() == [2, 2, 1]
    found = reach(valid=valid, over=over, kept=kept)
    assert (found.frames, found.dubbed, found.overlaid) == (40, 37, 2)
    assert found.reasons == {"no face": 1, "covered": 2}
    assert found.yaw == Angles(low=-3.1, high=31.1, most=33.0)  # not the 80 of no face
    assert found.pitch == Angles(3.0, 3.0, 3.0)
    assert found.share == 37 / 40
    assert found.short
    assert not reach(kept=np.isin(np.arange(40), [1, 2]).astype(int)).short  # 95 %


def test_all_of_it_is_a_short_sentence() -> None:
    words = reach().in_words()
    assert words == (
        "all frames dubbed, head turned 3 degrees left to 32 right (80 right at most), "
        "tilted 3 degrees up"
    )


def test_a_sentence_says_why_not() -> None:
    kept, over = np.zeros(40, int), np.zeros(40, bool)
    kept[:1], kept[5:8], over[20] = 1, 2, True
    words = reach(kept=kept, over=over).in_words("can be dubbed")
    assert words.startswith("90 % of the frames can be dubbed, head turned ")
    assert words.endswith(
        "; 10 % not: no face in 1 frame, covered in 3; something lies over the face in 2 %"
    )


def test_no_rounding_makes_all_of_some_or_none_of_some() -> None:
    nearly = Reach(1000, 999, 1, {"turned": 1}, None, None)
    assert nearly.in_words() == (
        "99 % of the frames dubbed; 1 % not: turned in 1 frame; something lies over the face in 1 %"
    )
    none = Reach(3, 0, 0, {"no face": 3}, None, None)
    assert none.in_words() == "0 % of the frames dubbed; 100 % not: no face in 3 frames"
    assert (none.turned(), none.tilted()) == ("", "")


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        (Angles(10, 42, 48), "10 to 42 degrees right (48 right at most)"),
        (Angles(10, 42, 42.3), "10 to 42 degrees right"),
        (Angles(-42, -10, -42), "10 to 42 degrees left"),
        (Angles(-42, -10, 50), "10 to 42 degrees left (50 right at most)"),
        (Angles(-5, 0.3, -5), "0 to 5 degrees left"),
        (Angles(-5, 12, -5), "5 degrees left to 12 right"),
        (Angles(7.1, 7.4, 7.4), "7 degrees right"),
        (Angles(-0.2, 0.3, 0.3), "0 degrees"),
    ],
)
def test_angles_in_words(angles: Angles, words: str) -> None:
    assert angles.in_words("left", "right") == words
