from fractions import Fraction

import numpy as np
import pytest

from dubbing.errors import RenderingError
from dubbing.timeline import frame_count, pose_index, runs

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


def test_bounce_stays_in_its_shot() -> None:
    assert list(pose_index(9, TWO_SHOTS, 3, "bounce")) == [3, 4, 5, 4, 3, 4, 5, 4, 3]
    assert list(pose_index(5, TWO_SHOTS, 9, "bounce")) == [9, 9, 9, 9, 9]


def test_loop_hold_and_cut() -> None:
    assert list(pose_index(5, ONE_SHOT, 8, "loop")) == [8, 9, 8, 9, 8]
    assert list(pose_index(5, ONE_SHOT, 8, "hold")) == [8, 9, 9, 9, 9]
    assert list(pose_index(5, ONE_SHOT, 8, "cut")) == [8, 9]


def test_fail_says_what_to_do() -> None:
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
    if frames > len(segment) - first:
        assert set(segment[index]) == {segment[first]}


@pytest.mark.parametrize("seed", range(50))
def test_runs_put_together_are_the_index(seed: int) -> None:
    index = np.random.default_rng(seed).integers(0, 3, seed + 1)
    rebuilt = [first + step * k for first, length, step in runs(index) for k in range(length)]
    assert rebuilt == index.tolist()


def test_runs_of_a_bounce() -> None:
    index = pose_index(9, ONE_SHOT, 7, "bounce")
    assert runs(index) == [(7, 3, 1), (8, 2, -1), (8, 2, 1), (8, 2, -1)]
