"""Where the face of a line stays the film's own, in all or in part, and why.

T frames of a clip.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from typing_extensions import TypedDict

from dubbing.preparation.prepared import PreparedClip
from dubbing.preparation.tracking.reach import NOT_SEEN, Reach, hidden, reach_of, views_of

# Degrees between a view of the head and the nearest that was learned: beyond, it is not rendered.
FARTHEST_VIEW = 20.0
# Degrees from the front beyond which a face in which no landmarks are found is a profile: where its
# mouth is can only be guessed.
PROFILE = 60.0
REASONS = (*NOT_SEEN, "turned", "asked for")  # by their numbers
ASKED = REASONS.index("asked for")  # by the edit of a line
OVERLAID = ("", "something lies over it")


class OwnPixels(TypedDict):
    """Frames first .. stop of a dub in which a cue keeps of the film's face, and the reason."""

    cue: str
    reason: str
    first: int
    stop: int


def reasons(clip: PreparedClip, learned: np.ndarray) -> np.ndarray:
    """Number of the reason, (T,) int, why the face of each frame is not replaced; 0: it is.

    Args:
        learned: (L, 3) views that were learned from; see `views`.
    """
    seen = views(clip)
    turned = (seen @ learned.T).max(1) < np.cos(np.deg2rad(FARTHEST_VIEW))
    turned |= ~clip.detected & (-seen[:, 2] < np.cos(np.deg2rad(PROFILE)))
    return np.select([~clip.valid, clip.covered, turned], [1, 2, 3], 0)


def views(clip: PreparedClip) -> np.ndarray:
    """Unit vectors (T, 3) from the head to the camera, in the head frame."""
    return views_of(clip.rotation, clip.translation)


def learned_views(clip: PreparedClip, seconds: Sequence[tuple[float, float]]) -> np.ndarray:
    """Views (L, 3) of the frames in which the face is detected, from one second to another."""
    learned = np.zeros(len(clip), bool)
    for start, stop in seconds:
        learned[round(start * clip.rate) : round(stop * clip.rate)] = True
    return views(clip)[learned & clip.detected]


def own_pixels(
    name: str, first: int, found: np.ndarray, reasons: Sequence[str] = REASONS
) -> list[OwnPixels]:
    """Runs of numbers (F,) of reasons of a cue's frames from ``first`` on."""
    edges = np.flatnonzero(np.diff(found, prepend=-1, append=-1))
    return [
        OwnPixels(
            cue=name, reason=reasons[found[low]], first=first + int(low), stop=first + int(to)
        )
        for low, to in pairwise(edges)
        if found[low]
    ]


def reach(
    clip: PreparedClip, frames: np.ndarray | None = None, kept: np.ndarray | None = None
) -> Reach:
    """How much of some frames (F,) of a clip is dubbed; of all by default.

    Args:
        kept: (F,) numbers of `reasons`; before they are known, those that preparation knows.
    """
    some = np.arange(len(clip)) if frames is None else frames
    own = hidden(clip.valid, clip.covered)[some] if kept is None else kept
    seen = views_of(clip.rotation[some], clip.translation[some])
    return reach_of(seen, clip.valid[some], clip.over[some], own, REASONS)
