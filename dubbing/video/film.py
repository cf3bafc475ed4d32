"""Frames of the film under a dub, whichever way they run."""

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip
from dubbing.script import timeline

BACKWARDS = 25  # frames decoded forwards and kept, to be given out in reverse

Picture = TypeVar("Picture")


def read_frames(clip: PreparedClip, poses: np.ndarray) -> Iterator[FilmFrame]:
    """The film's frame for every pose, whichever way they run."""
    return in_order(clip.film_frames, poses)


def read_film(clip: PreparedClip, poses: np.ndarray) -> Iterator[np.ndarray]:
    """The frames of the film a clip was prepared from, whichever way they run."""
    return in_order(clip.whole_frames, poses)


def in_order(
    forward: Callable[[int, int], Iterator[Picture]], poses: np.ndarray
) -> Iterator[Picture]:
    """Frames that ``forward`` reads from a first one on, for every pose, whichever way they run."""
    for first, length, step in timeline.runs(poses):
        if step == 0:
            (still,) = forward(first, 1)
            yield from (still for _ in range(length))
        elif step == 1:
            yield from forward(first, length)
        else:
            for done in range(0, length, BACKWARDS):
                count = min(BACKWARDS, length - done)
                last = first - done
                yield from reversed(list(forward(last - count + 1, count)))
