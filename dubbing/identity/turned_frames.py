"""Chooses frames of a person's clips in which the head is turned as in no learned second.

A film that is dubbed often shows its person from where the learned seconds do not. What the head
looks like from there is learned from it, whatever is said there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from dubbing.identity.clip_frames import ClipFrames
from dubbing.preparation.tracking.reach import views_of

FURTHER = np.radians(8.0)  # from every learned view: nearer ones are learned well enough
APART = np.radians(2.0)  # views nearer to one another show the same
MOST = 40  # frames


def with_turned(footage: Sequence[ClipFrames]) -> list[ClipFrames]:
    """The learned frames of clips of one person, and up to `MOST` that are turned further.

    Each is the one furthest from all views so far; none is covered.
    """
    if not any(len(one.with_face) for one in footage):
        return list(footage)
    clips = [one.clip for one in footage]
    ends = np.cumsum([0, *map(len, clips)])
    views = np.concatenate([views_of(clip.rotation, clip.translation) for clip in clips])
    clear = np.concatenate([clip.detected & ~clip.covered & ~clip.over for clip in clips])
    learned = np.concatenate([a + one.with_face for a, one in zip(ends, footage, strict=False)])
    near = np.concatenate([(views[a:b] @ views[learned].T).max(1) for a, b in pairwise(ends)])
    left = np.where(clear & (near < np.cos(FURTHER)), near, np.inf)
    chosen: list[int] = []
    while len(chosen) < MOST and left.min() < np.cos(APART):
        chosen.append(int(left.argmin()))
        left = np.maximum(left, views @ views[chosen[-1]])
    turned = np.array(sorted(chosen), int)
    return [
        replace(one, frames=np.union1d(one.frames, turned[(turned >= a) & (turned < b)] - a))
        for one, (a, b) in zip(footage, pairwise(ends), strict=True)
    ]
