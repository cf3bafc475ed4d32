"""How many frames a dub has, and which frame of the clip each takes its pose and picture from.

F frames of the dub, T frames of the clip.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from dubbing.errors import RenderingError


def frame_count(seconds: float, rate: Fraction) -> int:
    """round(duration x rate), at least one frame; halves go up."""
    return max(1, math.floor(Fraction(seconds).limit_denominator(10**9) * rate + Fraction(1, 2)))


def first_frame(start: float, rate: Fraction) -> int:
    """Frame of a clip at ``start`` seconds."""
    return round(Fraction(start) * rate)


def pose_index(frames: int, segment: np.ndarray, first: int, policy: str) -> np.ndarray:
    """Frame of the clip for every frame of the dub, int64 (F,).

    A dub that is no longer than the clip follows it, its own cuts included. For a longer one:

    * ``bounce``: back and forth between ``first`` and the end of its shot, from the beginning on;
      later shots are not used, so the pose path is continuous and crosses no cut;
    * ``loop``: to the end of the clip, then from ``first`` again; ``hold``: its last frame stays;
    * ``cut``: the dub ends with the clip, so fewer frames come back; ``fail``: an error.

    Args:
        frames: F.
        segment: (T,) int, increases at every cut.
        first: frame of the clip to begin with.

    Raises:
        RenderingError: the clip is too short and the policy is ``fail``.
    """
    total = len(segment)
    left = total - first
    if left < 1:
        raise RenderingError(f"frame {first} is past the end of a clip of {total} frames")
    steps = np.arange(frames)
    if frames <= left:
        return first + steps
    if policy == "bounce":
        span = int(np.sum(segment[first:] == segment[first]))
        return first + triangle(steps, span)
    if policy == "loop":
        return first + steps % left
    if policy == "hold":
        return first + np.minimum(steps, left - 1)
    if policy == "cut":
        return first + steps[:left]
    raise RenderingError(
        f"the speech needs {frames} frames, the clip has {left} from there on",
        remedy="set on_longer_audio to bounce, loop, hold or cut, or use a longer clip",
    )


def triangle(steps: np.ndarray, span: int) -> np.ndarray:
    """0, 1, .. span - 1, span - 2, .. 0, 1, ..: neighbours differ by one (by none if span is 1)."""
    if span == 1:
        return np.zeros_like(steps)
    period = 2 * (span - 1)
    phase = steps % period
    return np.minimum(phase, period - phase)


def runs(index: np.ndarray) -> list[tuple[int, int, int]]:
    """Split a pose index into stretches (first, length, step) a decoder can follow.

    A stretch is ``first, first + step, ..``; step is 1, -1, or 0 where one frame repeats.
    """
    found: list[tuple[int, int, int]] = []
    start = 0
    while start < len(index):
        end = start + 1
        step = int(index[end] - index[start]) if end < len(index) else 1
        if step not in (-1, 0, 1):
            step = 1
        while end < len(index) and index[end] - index[end - 1] == step:
            end += 1
        found.append((int(index[start]), end - start, step))
        start = end
    return found
