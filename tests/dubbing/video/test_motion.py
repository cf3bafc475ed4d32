"""Vectors of rendered heads to the frames beside them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip
from dubbing.video import motion
from dubbing.video.heads import Face
from tests import clips, fakes

SIDE, SIZE = 256, 128  # px of the film and of the crop
PART = np.s_[40:80, 60:140]
MOVED = (3.0, -2.0)  # px of the crop in a frame, to the right and down


def heads() -> list[np.ndarray]:
    """Three heads, (S, S, 4), of which each has moved."""
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.uniform(0, 255, (2 * SIZE, 2 * SIZE, 3)), (0, 0), 3)
    picture = np.clip((picture - 127) * 8 + 127, 0, 255)
    found = []
    for k in range(3):
        shift = np.array([[1, 0, k * MOVED[0] - SIZE / 2], [0, 1, k * MOVED[1] - SIZE / 2]])
        moved = cv2.warpAffine(picture, shift, (SIZE, SIZE), flags=cv2.INTER_CUBIC)
        opaque = np.full((SIZE, SIZE, 1), 255)
        found.append(np.concatenate([moved, opaque], 2).clip(0, 255).astype(np.uint8))
    return found


@pytest.fixture
def clip(tmp_path: Path) -> PreparedClip:
    """A clip whose window moves by 4 px to the right and 6 px down in a frame."""
    film = clips.write_video(tmp_path / "film.mkv", 3, size=(400, 300))
    prepared = fakes.write_prepared(film, tmp_path / "prepared", size=SIZE)
    crop = np.array([(40 + 4 * k, 10 + 6 * k, SIDE, 0) for k in range(3)], float)
    return replace(prepared, crop=crop)


def face(clip: PreparedClip, *, share: float = 1.0) -> Face:
    before, head, after = heads()
    film: FilmFrame = next(clip.film_frames(1, 1))
    return Face(clip, film, head, share, (before, after))


def test_a_head_that_moves_has_these_vectors(clip: PreparedClip) -> None:
    replaced = np.zeros((120, 160), bool)
    replaced[30:90, 40:120] = True
    found = motion.motion([face(clip)], 1, replaced, (100, 60))
    scale = SIDE / SIZE
    right, down = 4 + scale * MOVED[0], 6 + scale * MOVED[1]
    expected = (-right, down, right, -down)  # Nuke counts upwards
    inside = found[40:80, 50:110]
    assert np.abs(np.median(inside, (0, 1)) - expected).max() < 0.2
    assert np.abs(inside - expected).mean() < 0.5
    assert not found[~replaced].any()


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_the_vectors_of_a_head_that_lies_are_those_of_the_film(
    clip: PreparedClip, turns: int
) -> None:
    """The same film, turned clockwise: its windows turn it back."""
    replaced = np.zeros((300, 400), bool)
    replaced[90:150, 140:220] = True
    expected = motion.motion([face(clip)], 1, replaced, (0, 0))
    width, height = clip.source_size
    size = (height, width) if turns % 2 else (width, height)
    lying = replace(clip, crop=clip.crop + np.array([0, 0, 0, turns]), source_size=size)
    film: FilmFrame = next(clip.film_frames(1, 1))
    before, head, after = heads()
    turned = np.rot90(replaced, -turns)
    part = turned[20:, 30:]
    found = motion.motion([Face(lying, film, head, 1, (before, after))], 1, part, (30, 20))
    back = np.rot90(np.pad(found, ((20, 0), (30, 0), (0, 0))), turns)
    for _ in range(turns):  # vectors, too, counterclockwise
        back = np.stack([-back[..., 1], back[..., 0], -back[..., 3], back[..., 2]], -1)
    inside = np.s_[95:145, 145:215]
    assert np.abs(expected[inside]).max() > 1
    np.testing.assert_allclose(back[inside], expected[inside], atol=0.25)


def test_nothing_moves_over_a_cut_or_the_end_of_a_cue(clip: PreparedClip) -> None:
    cut = replace(clip, segment=np.array([0, 0, 1]))
    assert motion.vectors(face(cut), 1, motion.FORWARD, PART) is None
    assert motion.vectors(face(cut), 1, motion.BACKWARD, PART) is not None
    alone = replace(face(clip), beside=(None, None))
    assert not motion.motion([alone], 1, np.ones((300, 400), bool), (0, 0)).any()


@pytest.mark.parametrize(("first", "stop"), [(0, 5), (0, 1), (2, 4), (4, 5)])
def test_heads_come_with_those_beside_them(first: int, stop: int) -> None:
    def read(start: int, count: int) -> Iterator[np.ndarray]:
        return iter(np.arange(start, start + count))

    found = [*motion.with_those_beside(read, first, stop, 5)]
    assert found == [
        (k, (k - 1 if k else None, k + 1 if k < 4 else None)) for k in range(first, stop)
    ]
