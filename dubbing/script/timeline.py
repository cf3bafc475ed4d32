"""The frames of a dub: their number, those with new speech, and the frame of the film of each.

F frames of the dub, T frames of the film.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from dubbing.engine.disk.files import digest_data
from dubbing.engine.graph.fields import Setting
from dubbing.errors import RenderingError
from dubbing.script.edit import Edit

TAKES, LONGEST_PLAIN = "takes", 20  # folder of takes; characters of the name of one that are read
NO_EDIT = Edit()
FADE = 3  # frames at a cue's edges over which the rendered head fades in and out


@dataclass(frozen=True)
class Cue:
    """Frames of a dub with new speech of one person.

    Attributes:
        identity: the person.
        first, stop: frames first .. stop of the dub.
        audio, audio_start, seconds: the speech: file, first second and length.
        number, speaker, words: of the line. No image or audio depends on them.
        edit: which only `render` depends on.
    """

    identity: str
    first: int
    stop: int
    audio: Path
    audio_start: float
    seconds: float
    number: Setting[int] = 1
    speaker: Setting[str] = ""
    words: Setting[str] = ""
    edit: Setting[Edit] = NO_EDIT

    @property
    def name(self) -> str:
        """The name of its folder: a person has at most one cue at a time."""
        return f"{self.identity}_{self.first:07d}-{self.stop:07d}"

    @property
    def taken(self) -> str:
        """The name of the folder of its take, where what was made of other takes stays."""
        return self.folder_of(self.edit.take)

    @property
    def recorded(self) -> str:
        """The name of the folder of what is heard, which takes of one recording share."""
        return self.folder_of(self.edit.take if self.edit.audio else "")

    def folder_of(self, take: str) -> str:
        """The name of the folder of a take; '' is the version without a name."""
        plain = re.sub("[^a-z0-9]+", "-", take.lower()).strip("-")[:LONGEST_PLAIN]
        return f"{self.name}/{TAKES}/{plain}-{digest_data(take)[:6]}" if take else self.name


def frame_count(seconds: float, rate: Fraction) -> int:
    """round(duration x rate), at least one frame; halves go up."""
    return max(1, math.floor(Fraction(seconds).limit_denominator(10**9) * rate + Fraction(1, 2)))


def first_frame(start: float, rate: Fraction) -> int:
    """Frame of a video at ``start`` seconds."""
    return round(Fraction(start) * rate)


def pose_index(frames: int, segment: np.ndarray, first: int, policy: str) -> np.ndarray:
    """Frame of the film for every frame of the dub, int64 (F,).

    A dub follows the film, its cuts included. Frames beyond the end of the film are, with

    * ``bounce``: its last shot, not before ``first``, backwards and forwards, so that the pose path
      is continuous;
    * ``loop``: the film from ``first`` again; ``hold``: its last frame;
    * ``cut``: left out, so fewer frames are returned; ``fail``: an error.

    Args:
        frames: F.
        segment: (T,) int, increases at every cut.
        first: frame of the film to begin with.

    Raises:
        RenderingError: the film is too short and the policy is ``fail``.
    """
    total = len(segment)
    left = total - first
    if left < 1:
        raise RenderingError(f"frame {first} is past the end of a clip of {total} frames")
    steps = np.arange(frames)
    if frames <= left:
        return first + steps
    if policy == "bounce":
        span = int(np.sum(segment[first:] == segment[-1]))
        return total - 1 - np.maximum(left - 1 - steps, triangle(steps - left + 1, span))
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


def shares(replaced: np.ndarray, index: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Share of the rendered face in each frame, float32 (F,) in 0..1.

    0 outside of ``replaced``. Inside it rises over `FADE` frames from an edge, and falls towards an
    edge; there is no fade at a cut of the film, or where the dub begins and ends.

    Args:
        replaced: (F,) bool, frames in which the face is to be replaced, and can be.
        index: (F,) frame of the film for each.
        segment: (T,) int, increases at every cut.
    """
    away = np.where(replaced, FADE + 1, 0)
    joined = (np.abs(np.diff(index)) <= 1) & (np.diff(segment[index]) == 0)
    for step in range(1, FADE + 1):
        low = away < step
        beside = np.zeros(len(replaced), bool)
        beside[1:] |= low[:-1] & joined
        beside[:-1] |= low[1:] & joined
        away[beside & (away > step)] = step
    share: np.ndarray = (away / (FADE + 1)).astype(np.float32)
    return share


def triangle(steps: np.ndarray, span: int) -> np.ndarray:
    """0, 1, .. span - 1, span - 2, .. 0, 1, ..: neighbours differ by one (by none if span is 1)."""
    if span == 1:
        return np.zeros_like(steps)
    period = 2 * (span - 1)
    phase = steps % period
    return np.minimum(phase, period - phase)


def runs(index: np.ndarray) -> list[tuple[int, int, int]]:
    """Split a pose index into runs (first, length, step) that a decoder can read in order.

    A run is ``first, first + step, ..``; step is 1, -1, or 0 where one frame repeats.
    """
    parts: list[tuple[int, int, int]] = []
    start = 0
    while start < len(index):
        end = start + 1
        step = int(index[end] - index[start]) if end < len(index) else 1
        if step not in (-1, 0, 1):
            step = 1
        while end < len(index) and index[end] - index[end - 1] == step:
            end += 1
        parts.append((int(index[start]), end - start, step))
        start = end
    return parts
