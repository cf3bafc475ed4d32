"""The cut detector on made sequences of frame differences."""

import itertools

import cv2
import numpy as np
import pytest

from dubbing.preparation.tracking.cuts import (
    find_cuts,
    flashed,
    same_structure,
    segments,
    thumbnail,
)


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
    difference[64:72] = 1.8, 3.3, 2.4, 10.1, 3.0, 5.2, 4.9, 2.6
    difference[72:80] = 6.8, 1, 1.4, 0.8, 0.7, 4.9, 1.7, 3.2
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


def room(seed: int = 0, seat: int = 0) -> np.ndarray:
    """A wall with shapes, and somebody before it who sits ``seat`` px aside."""
    noise = np.random.default_rng(seed).normal(0, 1, (180, 320, 3)).astype(np.float32)
    picture = 120 + 700 * cv2.GaussianBlur(noise, (0, 0), 6)
    cv2.ellipse(picture, (160 + seat, 100), (60, 80), 0, 0, 360, (200.0, 150.0, 130.0), -1)
    for side in (-25, 25):
        cv2.circle(picture, (160 + seat + side, 80), 9, (60.0, 40.0, 30.0), -1)
    return picture


@pytest.mark.parametrize(
    ("gain", "offset"), [(0.5, 0), (0.15, 0), (1.4, 0), (0.5, 120), ((1.3, 1.0, 0.6), 0)]
)
def test_a_sudden_change_of_light_is_no_cut(gain: object, offset: float) -> None:
    lamp = np.linspace(0.8, 1.2, 320)[:, None]
    lit = room(seat=1) * gain * lamp + offset
    one, other = (thumbnail(np.clip(x, 0, 255).astype(np.uint8)) for x in (room(), lit))
    assert same_structure(one, other)
    difference = quiet(50)
    difference[25] = 40
    assert find_cuts(difference, np.arange(50) == 25).tolist() == []


def lit_room(seat: int, gain: float) -> np.ndarray:
    return thumbnail(np.clip(room(seat=seat) * gain, 0, 255).astype(np.uint8))


def test_a_flash_is_no_cut_though_it_leaves_no_structure() -> None:
    film = [lit_room(k // 3, gain) for k, gain in enumerate((1, 1, 1, 6, 3, 1.2, 1))]
    assert not same_structure(film[2], film[3])
    assert [flashed(film[:k], film[k]) for k in range(1, 7)] == [0, 0, 0, 0, 2, 3]


def test_a_shot_that_is_cut_in_is_no_flash() -> None:
    other = thumbnail(np.clip(room(1), 0, 255).astype(np.uint8))
    assert not flashed([lit_room(0, 1), other], lit_room(0, 1))
    white = np.full_like(other, 250.0)
    assert not flashed([lit_room(0, 1), white], other)
    assert flashed([lit_room(0, 1), white], lit_room(0, 1)) == 1


@pytest.mark.parametrize("after", [room(1), room(0, 40)[:, ::-1], room(2) * 0.5])
def test_another_scene_is_a_cut_in_whatever_light(after: np.ndarray) -> None:
    one, other = (thumbnail(np.clip(x, 0, 255).astype(np.uint8)) for x in (room(), after))
    assert not same_structure(one, other)
