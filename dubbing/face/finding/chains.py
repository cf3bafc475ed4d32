"""Tracking mode on several parts of a clip side by side, which is faster than one after the other.

Landmarks that are followed from a detected face halve their distance from those of a face followed
for long with each frame: in `WARM_UP` frames to .02 px of the network's input, as much as rounding
makes. So each part of a shot begins that many frames early.

T frames; P = 478 points.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dubbing.face.finding.face_finder import FaceFinder, region_of
from dubbing.face.finding.landmarks import HALF
from dubbing.face.finding.regions import Region

LENGTH = 64  # frames
WARM_UP = 8  # frames
SIDE_BY_SIDE = 4


@dataclass(frozen=True)
class Chain:
    """Frames `first` up to `end`, which is not among them, followed from frame `start` on."""

    start: int
    first: int
    end: int


def groups(segment: np.ndarray) -> Iterator[list[Chain]]:
    """Chains of a clip, those together that are followed together.

    Args:
        segment: (T,) number of each frame's shot.
    """
    edges = [0, *(np.flatnonzero(np.diff(segment)) + 1).tolist(), len(segment)]
    chains = [
        Chain(max(a, first - WARM_UP), first, min(first + LENGTH, b))
        for a, b in pairwise(edges)
        for first in range(a, b, LENGTH)
    ]
    for k in range(0, len(chains), SIDE_BY_SIDE):
        yield chains[k : k + SIDE_BY_SIDE]


def follow(
    images: np.ndarray, fresh: Sequence[np.ndarray | None], chains: Sequence[Chain]
) -> dict[int, np.ndarray | None]:
    """The face that is followed in the frames of some chains; None where it is lost.

    Args:
        images: (T, H, W, 3) uint8 RGB.
        fresh: (P, 3) px of each frame's face by static mode, with which a chain starts.
    """
    finder = FaceFinder()
    followed: dict[Chain, list[Region]] = {}
    found: dict[int, np.ndarray | None] = {}
    for step in range(max(chain.end - chain.start for chain in chains)):
        left = [chain for chain in chains if chain.start + step < chain.end]
        frames = [chain.start + step for chain in left]
        if step == 0:
            faces = [[] if (p := fresh[t]) is None else [p + HALF] for t in frames]
        else:
            faces = finder.follow_all([images[t] for t in frames], [followed[c] for c in left])
        for chain, t, some in zip(left, frames, faces, strict=True):
            followed[chain] = [region_of(points) for points in some]
            if t >= chain.first:
                found[t] = some[0] - HALF if some else None
    return found
