"""How pixels of a rendered head move to the frames beside it. S side of the crop in px."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import cv2
import numpy as np

from dubbing.preparation.background.pixels import Part, extent
from dubbing.preparation.tracking.cropping import turned
from dubbing.video.heads import Face

Beside = tuple[np.ndarray | None, np.ndarray | None]
BACKWARD, FORWARD = -1, 1
ROOM = 16  # px of the crop beside the part in which pixels are looked for
STEP = 1 / 8  # px; finer ones would be noise, and larger files


def with_those_beside(
    read: Callable[[int, int], Iterator[np.ndarray]], first: int, stop: int, length: int
) -> Iterator[tuple[np.ndarray, Beside]]:
    """Heads first .. stop of a cue of so many, each with those before and after it.

    Args:
        read: gives so many (S, S, 4) uint8, from a first one of the cue on.
    """
    low, high = max(0, first - 1), min(length, stop + 1)
    none: tuple[np.ndarray | None] = (None,)
    heads = chain(none * (first == low), read(low, high - low), none * (stop == high))
    before, head = next(heads), next(heads)
    for after in heads:
        assert head is not None
        yield head, (before, after)
        before, head = head, after


def vectors(face: Face, index: int, way: int, part: Part) -> np.ndarray | None:
    """Where the pixels of a head are in the frame before (-1) or after (1), less where they are.

    (h, w, 2) float32 of a part of frame ``index``, turned as its window is, in px to the right and
    up, as Nuke counts, in steps of `STEP`. None at the edges of a cue and of a shot.
    """
    other, clip, beside = face.beside[way == FORWARD], face.clip, index + way
    if other is None or not 0 <= beside < len(clip):
        return None
    if clip.segment[beside] != clip.segment[index]:
        return None
    (*corner, side, _), size = clip.crop[index], len(other)
    scale, (rows, columns) = size / side, part
    # First and stop of the part in the crop, with room for what moves in and out of it.
    begins = [(k.start - c) * scale for k, c in zip((columns, rows), corner, strict=True)]
    ends = [(k.stop - c) * scale for k, c in zip((columns, rows), corner, strict=True)]
    left, top = (max(0, int(k) - ROOM) for k in begins)
    right, bottom = (int(k) + 1 + ROOM for k in ends)
    grey = [
        cv2.cvtColor(head[top:bottom, left:right, :3], cv2.COLOR_RGB2GRAY)
        for head in (face.head, other)
    ]
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    flow = search.calc(grey[0], grey[1], np.zeros((*grey[0].shape, 2), np.float32))
    half = (scale - 1) / 2
    place = np.array([[scale, 0, begins[0] + half - left], [0, scale, begins[1] + half - top]])
    shape = columns.stop - columns.start, rows.stop - rows.start
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    found = cv2.warpAffine(flow, place, shape, flags=how, borderMode=cv2.BORDER_REPLICATE)
    moved = (clip.crop[beside][:2] - corner).astype(np.float32)
    found = (
        (found * np.float32(1 / scale) + moved) * np.array([1, -1], np.float32) / np.float32(STEP)
    )
    return np.asarray(np.rint(found) * np.float32(STEP), np.float32)


def motion(
    faces: list[Face], index: int, replaced: np.ndarray, corner: tuple[int, int]
) -> np.ndarray:
    """Vectors (h, w, 4) float16 of a part of a frame: backward u and v, forward u and v.

    Args:
        faces: that are shown. corner: column and row of the part.
        replaced: (h, w) bool, the pixels that have any.
    """
    out = np.zeros((*replaced.shape, 4), np.float16)
    far = np.array(corner) + replaced.shape[::-1] - 1
    for face in faces:
        *place, side, turns = face.clip.crop[index].astype(int)
        first = turned(np.stack((corner, far)), turns, face.clip.source_size).min(0)
        left, top = place - first
        upright, upright_out = np.rot90(replaced, turns), np.rot90(out, turns)
        y, x = max(0, top), max(0, left)
        within = extent(upright[y : max(0, top + side), x : max(0, left + side)])
        if within[0] == slice(0, 0):
            continue
        rows, columns = _moved(within, x, y)
        own = upright[rows, columns, None]
        for k, way in enumerate((BACKWARD, FORWARD)):
            found = vectors(face, index, way, _moved((rows, columns), *first.tolist()))
            if found is not None:
                for _ in range(turns):  # back, clockwise
                    found = found[..., ::-1] * np.array([1, -1], np.float32)
                there = upright_out[rows, columns, 2 * k : 2 * k + 2]
                np.copyto(there, found, "same_kind", where=own)
    return out


def _moved(part: Part, right: int, down: int) -> Part:
    rows, columns = part
    return (
        slice(rows.start + down, rows.stop + down),
        slice(columns.start + right, columns.stop + right),
    )
