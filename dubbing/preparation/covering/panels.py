"""Panels over a face: boxes, bars and pictures, which straight edges bound.

H x W px are looked at; an eye distance is that of the outer corners of the eyes.
"""

from __future__ import annotations

import cv2
import numpy as np

# Eye distances, and shares:
LINE, OF_FACE = 0.8, 0.3  # length of a panel's edge, and of its part within the face
CLOSED = 0.75  # of it is seen there
GAP = 0.4  # in a straight edge, where the outline of the face moves over it
WHOLE = 0.8  # of a panel's edge: so much of the opposite one is seen
NEAR = 0.7  # width of a bar, at most, of which both edges lie over the face
BESIDE = 0.25  # from the nose to the one edge of a panel that ends nowhere
LEAST_PX = 20  # of it: in fewer, the gaps between small letters are not seen
EDGE = 8  # px: width of an edge, as it is seen


def panels_of(
    still: np.ndarray, other: np.ndarray, sure: np.ndarray, nose: float, eyes: float
) -> np.ndarray:
    """Panels (H, W) bool with a straight edge along a row.

    It lies between that edge and the opposite one, which is looked for on both sides. Where there
    is none, it lies on the side that the nose is not on, to the end of the picture, if it has a
    corner there, or is well beside the nose.

    Args:
        still, sure: edges (H, W) that lie along rows. other: along columns. nose: its row.
    """
    mask, gap = np.zeros_like(still), np.ones((1, 2 * round(GAP * eyes) + 1), np.uint8)
    three = np.ones((3, 1), np.uint8)  # an edge is some px wide, and rows are whole
    thick = cv2.dilate(still.astype(np.uint8), three)
    lines = cv2.morphologyEx(thick, cv2.MORPH_CLOSE, gap) > 0
    counts = cv2.dilate(sure.astype(np.uint8), three).sum(1)
    least = max(LEAST_PX, OF_FACE * eyes)
    for row in np.flatnonzero(counts >= least):
        columns = np.flatnonzero(sure[max(0, row - 1) : row + 2].any(0))
        ends = np.flatnonzero(np.diff(np.r_[0, lines[row].astype(np.int8), 0]))
        for first, stop in zip(ends[::2], ends[1::2], strict=True):
            own = columns[(columns >= first) & (columns < stop)]
            if stop - first < LINE * eyes or len(own) < least:
                continue
            if len(own) < CLOSED * np.ptp(own):  # the tops of letters have gaps
                continue
            seen = np.flatnonzero(thick[:, first:stop].mean(1) >= WHOLE)
            away = 1 if row > nose else -1
            opposite = {way: _nearest(seen, int(row), way) for way in (away, -away)}
            near = {way: end for way, end in opposite.items() if abs(end - row) < NEAR * eyes}
            if -away not in near:  # else it is the far edge of a bar, as of a pole
                outer = opposite[away]
                if not np.isfinite(outer) and (
                    abs(row - nose) > BESIDE * eyes
                    or _has_corner(other, int(row), (first, stop), away * round(OF_FACE * eyes))
                ):
                    outer = len(mask) - 1.0 if away > 0 else 0.0
                near[away] = outer
            for end in filter(np.isfinite, near.values()):
                low, high = sorted((int(row), round(end)))
                mask[low : high + 1, first:stop] = True
    return mask


def _has_corner(other: np.ndarray, row: int, ends: tuple[int, int], reach: int) -> bool:
    """Whether an edge (H, W) along columns goes on by `reach` px from an end of one in a row."""
    beyond = slice(max(0, min(row, row + reach)), max(row, row + reach))
    around = (other[beyond, max(0, end - EDGE) : end + EDGE] for end in ends)
    return any(part.size > 0 and float(np.mean(part.any(axis=1))) > CLOSED for part in around)


def _nearest(rows: np.ndarray, row: int, way: int) -> float:
    """The nearest of some rows that is more than an edge's width away on one side, or infinity."""
    apart = way * (rows - row)
    beyond = rows[apart >= EDGE]
    return float(beyond[np.abs(beyond - row).argmin()]) if len(beyond) else np.inf
