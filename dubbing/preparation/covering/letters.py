"""Lines of letters, and veils behind them: boxes on which captions are easier to read.

S is the side of the image in px.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import cv2
import numpy as np

from dubbing.preparation.background.pixels import extent

STEP = 10  # grey levels over two rows, at least, along the upper and the lower edge of a veil
LONG = 1.5  # of its height, a line of letters at least: a logo has no veil
LENGTH = 0.6  # of the letters, over which these edges are seen: not over an open mouth


def veils(image: np.ndarray, letters: np.ndarray) -> np.ndarray:
    """Pixels (S, S) uint8, 1 in boxes whose edges lie at most a line away from those of letters.

    Args:
        image: (S, S, 3) RGB uint8. letters: (S, S) uint8, 1 on letters and between them.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.int16)
    down, across = (np.zeros_like(grey) for _ in range(2))
    down[1:-1], across[:, 1:-1] = grey[2:] - grey[:-2], grey[:, 2:] - grey[:, :-2]
    out = np.zeros_like(letters)
    for top, bottom in lines(letters):
        line, last = bottom - top, len(grey) - 1
        seen = np.flatnonzero(letters[top:bottom].any(0))
        left, right = int(seen[0]), int(seen[-1])
        for sign in (
            (-1, 1) if right - left > LONG * line else ()
        ):  # darker than the picture, or brighter
            steps = sign * down[:, left : right + 1]
            upper = edge(steps, range(top, top - line, -1))
            lower = edge(-steps, range(bottom - 1, bottom + line))
            if upper is None or lower is None:
                continue
            steps = sign * across[upper : lower + 1].T
            first = edge(steps, range(left, left - line, -1))
            end = edge(-steps, range(right, right + line))
            # It may go on beyond the letters that can be told from what is behind them.
            sides = slice(max(0, left - line), left), slice(right, right + line)
            both = np.minimum(sign * down[upper], -sign * down[lower]) > STEP
            goes_on = [bool(both[at].mean() > LENGTH) for at in sides]
            if first is None and (left < line or goes_on[0]):
                first = sides[0].start
            if end is None and (right > last - line or goes_on[1]):
                end = sides[1].stop
            if first is not None and end is not None:
                out[upper : lower + 1, first : end + 1] = 1
    return out


def edge(steps: np.ndarray, rows: Iterable[int]) -> int | None:
    """The first of these rows in which most brightness (R, C) rises by `STEP`; None without one."""
    for row in rows:
        if 0 <= row < len(steps) and (steps[row] > STEP).mean() > LENGTH:
            return row
    return None


def beside(letters: np.ndarray, hole: np.ndarray) -> np.ndarray:
    """Pixels (S, S) uint8 of a hole, 1 in the rows of lines that go on at both sides of it.

    Args:
        letters, hole: (S, S) uint8.
    """
    out = np.zeros_like(letters)
    _, columns = extent(hole > 0)
    for top, bottom in lines(np.where(hole, 0, letters)):
        line, seen = bottom - top, letters[top:bottom].max(0)
        left = seen[max(0, columns.start - line) : columns.start]
        right = seen[columns.stop : columns.stop + line]
        if left.any() and right.any():
            out[top:bottom] = hole[top:bottom]
    return out


def lines(letters: np.ndarray) -> Iterator[tuple[int, int]]:
    """First row, and the row after the last, of every line of letters (S, S)."""
    seen = np.pad(letters.any(1).astype(np.int8), 1)
    yield from list(pairwise(np.flatnonzero(np.diff(seen)).tolist()))[::2]
