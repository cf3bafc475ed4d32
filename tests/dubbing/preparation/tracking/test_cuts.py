"""The cut detector on made sequences of frame differences."""

import itertools

import numpy as np

from dubbing.preparation.tracking.cuts import find_cuts, segments, thumbnail


def quiet(frames: int) -> np.ndarray:
    difference = np.abs(np.random.default_rng(0).normal(0.6, 0.3, frames))
    difference[0] = 0
    return difference


def test_hard_cuts_are_found_at_their_frames() -> None:
    difference = quiet(300)
    difference[[100, 101, 250]] = [12.0, 9.0, 18.0]  # two cuts next to each other, and one alone
    assert find_cuts(difference).tolist() == [100, 101, 250]
    shots = segments(300, find_cuts(difference))
    assert shots[[0, 99, 100, 101, 249, 250, 299]].tolist() == [0, 0, 1, 2, 2, 3, 3]


def test_fast_motion_is_no_cut() -> None:
    difference = quiet(300)
    # Arms that begin to wave, measured on a clip of 25 frames a second made from fewer.
    difference[64:80] = [
        1.8,
        3.3,
        2.4,
        10.1,
        3.0,
        5.2,
        4.9,
        2.6,
        6.8,
        1,
        1.4,
        0.8,
        0.7,
        4.9,
        1.7,
        3.2,
    ]
    assert find_cuts(difference).tolist() == []


def test_constant_shaking_is_no_cut() -> None:
    assert find_cuts(np.full(100, 9.0)).tolist() == []


def test_a_cut_near_the_start_is_found() -> None:
    difference = quiet(50)
    difference[1] = 20
    assert find_cuts(difference).tolist() == [1]


def test_pictures_of_two_scenes() -> None:
    rng = np.random.default_rng(1)
    scenes = [rng.integers(0, 255, (12, 16, 3), np.uint8).repeat(20, 0).repeat(20, 1) for _ in "ab"]
    film = [scenes[0]] * 30 + [scenes[1]] * 30
    small = [
        thumbnail(np.clip(f + rng.normal(0, 2, f.shape), 0, 255).astype(np.uint8)) for f in film
    ]
    difference = np.array([0.0] + [np.abs(b - a).mean() for a, b in itertools.pairwise(small)])
    assert find_cuts(difference).tolist() == [30]
