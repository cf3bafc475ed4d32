from fractions import Fraction

import numpy as np
import pytest

from dubbing.errors import RenderingError
from dubbing.script.timeline import frame_count, pose_index, runs, shares

ONE_SHOT = np.zeros(10, int)
TWO_SHOTS = np.array([0] * 6 + [1] * 4)


@pytest.mark.parametrize(
    ("seconds", "rate", "frames"),
    [
        (10.0, Fraction(25), 250),
        (10.02, Fraction(25), 251),  # 250.5: a half goes up
        (10.019, Fraction(25), 250),
        (10.0, Fraction(24000, 1001), 240),  # 239.76
        (3600.0, Fraction(30000, 1001), 107892),
        (0.001, Fraction(25), 1),
    ],
)
def test_frame_count_is_duration_times_rate(seconds: float, rate: Fraction, frames: int) -> None:
    assert frame_count(seconds, rate) == frames


def test_while_the_clip_lasts_it_is_followed_with_its_cuts() -> None:
    for policy in ("bounce", "loop", "hold", "cut", "fail"):
        assert list(pose_index(7, TWO_SHOTS, 3, policy)) == [3, 4, 5, 6, 7, 8, 9]


def test_bounce_goes_back_and_forth() -> None:
    expected = [7, 8, 9, 8, 7, 8, 9, 8]
    assert list(pose_index(8, ONE_SHOT, 7, "bounce")) == expected


def test_bounce_follows_the_film_first_and_stays_in_its_last_shot() -> None:
    film = [3, 4, 5, 6, 7, 8, 9]
    assert list(pose_index(14, TWO_SHOTS, 3, "bounce")) == [*film, 8, 7, 6, 7, 8, 9, 8]
    assert list(pose_index(6, TWO_SHOTS, 8, "bounce")) == [8, 9, 8, 9, 8, 9]
    assert list(pose_index(5, TWO_SHOTS, 9, "bounce")) == [9, 9, 9, 9, 9]


@pytest.mark.parametrize("policy", ["bounce", "hold", "loop", "cut"])
def test_one_frame_too_many_throws_nothing_of_the_film_away(policy: str) -> None:
    segment = np.repeat([0, 1, 2], [38, 30, 32])
    assert list(pose_index(101, segment, 0, policy)[:100]) == list(range(100))


def test_loop_hold_and_cut() -> None:
    assert list(pose_index(5, ONE_SHOT, 8, "loop")) == [8, 9, 8, 9, 8]
    assert list(pose_index(5, ONE_SHOT, 8, "hold")) == [8, 9, 9, 9, 9]
    assert list(pose_index(5, ONE_SHOT, 8, "cut")) == [8, 9]


def test_fail_gives_a_remedy() -> None:
    with pytest.raises(RenderingError, match="on_longer_audio"):
        pose_index(5, ONE_SHOT, 8, "fail")
    with pytest.raises(RenderingError, match="past the end"):
        pose_index(5, ONE_SHOT, 10, "bounce")


@pytest.mark.parametrize("seed", range(50))
def test_bounce_never_jumps(seed: int) -> None:
    chance = np.random.default_rng(seed)
    shots = chance.integers(1, 10, chance.integers(1, 5))
    segment = np.repeat(np.arange(len(shots)), shots)
    first = int(chance.integers(len(segment)))
    frames = int(chance.integers(1, 200))
    index = pose_index(frames, segment, first, "bounce")
    assert len(index) == frames
    assert index[0] == first
    assert np.abs(np.diff(index)).max(initial=0) <= 1
    left = len(segment) - first
    assert list(index[:left]) == list(range(first, len(segment)))[:frames]
    assert set(segment[index[left:]]) <= {segment[-1]}
    assert index.min() == first


@pytest.mark.parametrize("seed", range(50))
def test_runs_put_together_are_the_index(seed: int) -> None:
    index = np.random.default_rng(seed).integers(0, 3, seed + 1)
    rebuilt = [first + step * k for first, length, step in runs(index) for k in range(length)]
    assert rebuilt == index.tolist()


def test_runs_of_a_bounce() -> None:
    index = pose_index(9, ONE_SHOT, 7, "bounce")
    assert runs(index) == [(7, 3, 1), (8, 2, -1), (8, 2, 1), (8, 2, -1)]


def test_a_face_fades_in_and_out_inside_its_cue() -> None:
    index, one_shot = np.arange(20), np.zeros(20, int)
    replaced = np.zeros(20, bool)
    replaced[5:15] = True
    wanted = [0] * 5 + [0.25, 0.5, 0.75, 1, 1, 1, 1, 0.75, 0.5, 0.25] + [0] * 5
    np.testing.assert_allclose(shares(replaced, index, one_shot), wanted)
    # Where the dub begins and ends there is no frame to fade from.
    np.testing.assert_array_equal(shares(np.ones(20, bool), index, one_shot), 1)
    # A cut hides the change.
    cut = np.repeat([0, 1], [5, 15])
    np.testing.assert_allclose(shares(replaced, index, cut)[:8], [0] * 5 + [1] * 3)
    # A short cue never becomes whole, and one frame is the least of it.
    brief = np.zeros(20, bool)
    brief[7:9] = True
    np.testing.assert_allclose(shares(brief, index, one_shot)[6:10], [0, 0.25, 0.25, 0])


def test_two_cues_that_touch_are_one_to_the_eye() -> None:
    replaced = np.zeros(12, bool)
    replaced[2:6] = replaced[6:10] = True
    found = shares(replaced, np.arange(12), np.zeros(12, int))
    np.testing.assert_allclose(found[2:10], [0.25, 0.5, 0.75, 1, 1, 0.75, 0.5, 0.25])


def test_a_jump_of_the_clip_is_a_cut() -> None:
    replaced = np.array([True, True, True, False, False])
    found = shares(replaced, np.array([7, 8, 9, 0, 1]), np.zeros(12, int))
    np.testing.assert_array_equal(found, [1, 1, 1, 0, 0])
