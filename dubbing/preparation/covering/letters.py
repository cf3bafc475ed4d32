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
AWAY = 1.5  # of its height, edges may be: letters without ascenders are low
LENGTH = 0.6  # of the letters, over which these edges are seen: not over an open mouth
ROUND = 4  # of the line's height, a box extends a part beyond its letters, if its corners are round
ALIKE = 12.0  # levels from the colour of a box


def veils(image: np.ndarray, letters: np.ndarray) -> np.ndarray:
    """Pixels (S, S) uint8, 1 in boxes whose edges are near those of lines of letters.

    Args:
        image: (S, S, 3) RGB uint8. letters: (S, S) uint8, 1 on letters and between them.
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.int16)
    down, across = (np.zeros_like(grey) for _ in range(2))
    down[1:-1], across[:, 1:-1] = grey[2:] - grey[:-2], grey[:, 2:] - grey[:, :-2]
    out = np.zeros_like(letters)
    for line in lines(letters):
        for sign in (-1, 1):  # darker than the picture, or brighter
            _add_veil(out, image, letters, (sign * down, sign * across), line)
    return out


def _add_veil(
    out: np.ndarray,
    image: np.ndarray,
    letters: np.ndarray,
    steps: tuple[np.ndarray, np.ndarray],
    line: tuple[int, int],
) -> None:
    """Sets the pixels of `out` that lie in the box of a line, if it has one.

    Args:
        steps: (S, S) grey levels that the picture rises by into a box, downwards and to the right.
        line: see `lines`.
    """
    (down, across), (top, bottom) = steps, line
    height, last = bottom - top, len(out) - 1
    seen = np.flatnonzero(letters[top:bottom].any(0))
    left, right, away = int(seen[0]), int(seen[-1]), round(AWAY * height)
    over = slice(left, right + 1)
    upper = edge(down[:, over], range(top, top - away, -1))
    lower = edge(-down[:, over], range(bottom - 1, bottom + away))
    if right - left <= LONG * height or upper is None or lower is None:
        return
    both, rows = np.minimum(down[upper], -down[lower]) > STEP, slice(upper, lower + 1)
    first, end = left - run(both[:left][::-1], height), right + run(both[right + 1 :], height)
    alike = of_one_colour(image[rows], letters[rows], slice(first, end + 1))
    goes_on = alike.mean(0) > LENGTH  # as that of a box with round corners
    begin = edge(across[rows].T, range(left, left - height, -1))
    ending = edge(-across[rows].T, range(right, right + height))
    more = height // ROUND + 1
    begins = begin is not None or left - first >= more or left < height or goes_on[left - more]
    ends = ending is not None or end - right >= more or right > last - height
    if begins and (ends or goes_on[right + more]):
        first = first if begin is None else min(first, begin)
        end = end if ending is None else max(end, ending)
        near = slice(max(0, first - height), end + 1 + height)
        out[rows, first : end + 1] = 1
        _, pieces = cv2.connectedComponents(out[rows, near] | alike[:, near])
        out[rows, near] = np.isin(pieces, pieces[out[rows, near] > 0])


def run(seen: np.ndarray, height: int) -> int:
    """How far the edges of a box, seen in columns (C,) bool, go on, with gaps under a height."""
    far = 0
    while seen[far : far + height].any() and seen[far : far + height].mean() > LENGTH:
        far += int(np.flatnonzero(seen[far : far + height])[-1]) + 1
    return far


def of_one_colour(image: np.ndarray, letters: np.ndarray, columns: slice) -> np.ndarray:
    """Pixels (H, W) uint8 of the colour that lies between letters in some columns.

    Args:
        image: (H, W, 3). letters: (H, W) uint8, 1 there.
    """
    bare = image[:, columns][letters[:, columns] == 0]
    if not len(bare):
        return np.zeros_like(letters)
    return (np.abs(image - np.median(bare, 0)).max(-1) < ALIKE).astype(np.uint8)


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
