"""Detects dissolves from one shot into another.

In a dissolve every frame is a mixture of the image before it and the image after it, and the share
of the latter rises evenly. The same holds for a slow pan; but a frame of a pan has as much detail
as those images, and a frame of a dissolve has less. A fade to one colour counts as light. T frames.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.preparation.tracking.cuts import FINE, same_structure

SIDE = 32  # px of a miniature
LENGTHS = (6, 9, 13, 19, 27, 38, 54, 76)  # frames from the image before to the one after
LEAST_DIFFERENCE = 10.0  # mean difference of these two, grey levels
MOST_RESIDUAL = 0.15  # of that difference, that no mixture explains
UNEVEN = 0.15  # largest deviation of the share from an even rise
# Ratio of the energy of detail in the middle to that without mixing: about half in a dissolve.
LEAST_LOSS = 0.75
PLAIN = 6.0  # grey levels, deviation of an image of one colour


@dataclass(frozen=True)
class Dissolve:
    """Frames first .. first + len(share) - 1, and the share (n,) of the later shot in each."""

    first: int
    share: np.ndarray

    @property
    def middle(self) -> int:
        """The first frame that shows more of the later shot."""
        return self.first + int(np.searchsorted(self.share, 0.5))

    @property
    def stop(self) -> int:
        """The first frame after it."""
        return self.first + len(self.share)


def miniature(thumbnail: np.ndarray) -> np.ndarray:
    """A grey image (SIDE, SIDE) of a thumbnail (H, W) float32."""
    return np.asarray(cv2.resize(thumbnail, (SIDE, SIDE), interpolation=cv2.INTER_AREA))


def detail(thumbnail: np.ndarray) -> float:
    """Energy of the fine detail in a thumbnail (H, W) float32, squared grey levels."""
    return float(np.mean((thumbnail - cv2.GaussianBlur(thumbnail, (0, 0), FINE)) ** 2))


def find_dissolves(miniatures: np.ndarray, details: np.ndarray) -> list[Dissolve]:
    """Dissolves in the order of their frames; none overlaps another.

    Args:
        miniatures: (T, SIDE, SIDE) of all frames. details: (T,) as of `detail`.
    """
    flat = miniatures.reshape(len(miniatures), -1).astype(np.float32)
    plain = flat.std(1) < PLAIN
    candidates: list[tuple[float, Dissolve]] = []
    for length in LENGTHS:
        across = flat[length:] - flat[:-length]
        large = np.abs(across).mean(1) > LEAST_DIFFERENCE
        for first in map(int, np.flatnonzero(large & ~plain[length:] & ~plain[:-length])):
            window = slice(first, first + length + 1)
            score, share = _mixture(flat[window])
            if score > 0 and _loses_detail(details[window], share):
                candidates.append((score, Dissolve(first + 1, share)))
    kept: list[Dissolve] = []
    for _, one in sorted(candidates, key=lambda pair: -pair[0]):
        before, after = miniatures[one.first - 1], miniatures[one.stop]
        apart = all(one.first > other.stop or one.stop < other.first for other in kept)
        if apart and not same_structure(before, after):
            kept.append(one)
    return sorted(kept, key=lambda one: one.first)


def _mixture(flat: np.ndarray) -> tuple[float, np.ndarray]:
    """Score of images (n + 2, D) as mixtures of the first and the last; 0 where they are none.

    And the share (n,) of the last in those between.
    """
    across = flat[-1] - flat[0]
    size = float(np.abs(across).mean())
    between = flat[1:-1] - flat[0]
    share = between @ across / float(across @ across)
    left = np.abs(between - share[:, None] * across).mean(1) / size
    even = np.arange(1, len(flat) - 1) / (len(flat) - 1)
    uneven = float(np.abs(share - even).max())
    if left.mean() > MOST_RESIDUAL or uneven > UNEVEN:
        return 0.0, share
    return size * (1 - uneven / UNEVEN / 2), np.clip(share, 0, 1)


def _loses_detail(details: np.ndarray, share: np.ndarray) -> bool:
    """Whether images between the first and the last (n + 2,) have less detail than those."""
    middle = (share > 0.3) & (share < 0.7)
    amplitude = np.sqrt(details)  # which a fade changes evenly
    unmixed = ((1 - share) * amplitude[0] + share * amplitude[-1]) ** 2
    lost = details[1:-1][middle] / np.maximum(unmixed[middle], 1e-9)
    return bool(middle.any() and np.median(lost) < LEAST_LOSS)


def shown(frames: int, dissolves: list[Dissolve]) -> np.ndarray:
    """Share of every frame (T,) float32 that is of the shot it is assigned to."""
    out = np.ones(frames, np.float32)
    for one in dissolves:
        out[one.first : one.stop] = np.maximum(one.share, 1 - one.share)
    return out
