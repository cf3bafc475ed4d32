"""Dissolves of made pictures, and what looks like one: fades, motion, lamps."""

import cv2
import numpy as np
import pytest

from dubbing.preparation.tracking.cuts import thumbnail
from dubbing.preparation.tracking.dissolves import detail, find_dissolves, miniature, shown

PAN = 9  # frames in which the camera turns by a pixel
AT = 20  # frames before a dissolve begins


def scene(seed: int) -> np.ndarray:
    """A picture (90, 160, 3) float32 with shapes, large and small."""
    noise = np.random.default_rng(seed).normal(0, 1, (90, 160, 3)).astype(np.float32)
    parts = [strength * cv2.GaussianBlur(noise, (0, 0), s) for s, strength in ((8, 800), (2, 60))]
    return 128 + parts[0] + parts[1]


Film = tuple[np.ndarray, np.ndarray]


def looked_at(pictures: list[np.ndarray]) -> Film:
    """Miniatures (T, S, S) and details (T,)."""
    small = [thumbnail(np.clip(picture, 0, 255).astype(np.uint8)) for picture in pictures]
    return np.stack([miniature(s) for s in small]), np.array([detail(s) for s in small])


def film(first: np.ndarray, last: np.ndarray, frames: int) -> Film:
    """A shot, ``frames`` of a dissolve, and another shot."""
    share = np.concatenate([np.zeros(AT), np.arange(1, frames + 1) / (frames + 1), np.ones(AT)])
    rng = np.random.default_rng(0)
    made = []
    for k, part in enumerate(share):
        moved = [np.roll(picture, k // PAN, 1) for picture in (first, last)]  # a pan within shots
        made.append((1 - part) * moved[0] + part * moved[1] + rng.normal(0, 3, first.shape))
    return looked_at(made)


@pytest.mark.parametrize("frames", [6, 12, 25, 50])
def test_a_dissolve_is_found_with_its_shares(frames: int) -> None:
    (one,) = find_dissolves(*film(scene(0), scene(1), frames))
    assert abs(one.middle - (AT + frames // 2)) <= 1
    share = shown(2 * AT + frames, [one])
    true = np.arange(1, frames + 1) / (frames + 1)
    expected = np.maximum(true, 1 - true)
    assert np.abs(share[AT : AT + frames] - expected).max() < 0.15
    assert (share[: AT - 3] == 1).all()
    assert (share[AT + frames + 3 :] == 1).all()


@pytest.mark.parametrize(
    "last",
    [scene(0) * 0, scene(0) * 0 + 255, scene(0) * 0.3, scene(0) * 0.4 + 140, scene(0)],
    ids=["to black", "to white", "a cloud", "haze", "nothing"],
)
def test_what_changes_the_light_of_one_scene_is_no_dissolve(last: np.ndarray) -> None:
    assert not find_dissolves(*film(scene(0), last, 25))


def test_a_cut_a_pan_and_a_head_that_moves_are_no_dissolves() -> None:
    assert not find_dissolves(*film(scene(0), scene(1), 0))
    for fast in (1, 3):
        pan = [np.roll(scene(0), k // fast, 1) for k in range(60)]
        assert not find_dissolves(*looked_at(pan))
    grey = scene(0)
    frames = []
    for k in range(40):
        picture = grey.copy()
        cv2.circle(picture, (20 + 3 * k, 45), 25, (230.0, 180.0, 160.0), -1)
        frames.append(picture)
    assert not find_dissolves(*looked_at(frames))


def test_two_dissolves_in_a_row() -> None:
    one, other = (film(scene(a), scene(b), 15) for a, b in ((0, 1), (1, 2)))
    found = find_dissolves(*map(np.concatenate, zip(one, other, strict=True)))
    middles = [AT + 7, 2 * AT + 15 + AT + 7]
    assert [abs(d.middle - m) <= 1 for d, m in zip(found, middles, strict=True)] == [True, True]
