"""The frames of a dub: their number, those with new speech, and the frame of the film of each.

F frames of the dub, T frames of the film.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from dubbing.engine.disk.files import digest_data
from dubbing.engine.graph.fields import Setting
from dubbing.errors import RenderingError

HELD, AROUND = 0.04, 0.12  # s beside a key: its strength holds, and has gone
AS_SPOKEN = "as spoken"
# See `sound_to_lips.speech_frames.styled`.
STYLES = {AS_SPOKEN: 0.0, "softer": -1.0, "clearer": 1.0}
TAKES, LONGEST_PLAIN = "takes", 20  # folder of takes; characters of the name of one that are read
FADE = 3  # frames at a cue's edges over which the rendered head fades in and out


@dataclass(frozen=True)
class Edit:
    """How the mouth of a cue differs from what its speech asks for.

    Attributes:
        shift: ms by which it comes later than the sound.
        strength: how far the lips leave the closed mouth: 0 never, 1 as spoken.
        note: for people.
        keys: seconds of the cue's sound, and the strength there.
        status: open, approved or redo; for people.
        curves: a file, and the line in it whose lips take the place of those heard.
        take: its name, where the line has several; for people.
        audio: the recording of that take, where it has one of its own; a cue has it as `audio`.
        takes: all versions of the line by name, that without a name first; of one alone, none.
        film_mouth: from and to, in seconds of the cue, where the face stays the film's own. Which
            only a video depends on.
        style: of `STYLES`.
        moved: from and to, in seconds of the cue's sound, and ms by which the mouth of that part
            comes later than that of the whole.
    """

    shift: float = 0.0
    strength: float = 1.0
    note: Setting[str] = ""
    keys: tuple[tuple[float, float], ...] = ()
    status: Setting[str] = "open"
    curves: tuple[Path, int] | None = None
    take: Setting[str] = ""
    film_mouth: tuple[tuple[float, float], ...] = ()
    audio: Setting[Path | None] = None
    takes: Setting[tuple[tuple[str, Edit], ...]] = ()
    moved: tuple[tuple[float, float, float], ...] = ()
    style: str = AS_SPOKEN

    @property
    def of_lips(self) -> bool:
        """Whether it changes how the lips move, and not only when."""
        return self.curves is not None or bool(self.keys) or self.strength != 1

    def heard(self, frames: int, rate: Fraction) -> np.ndarray:
        """The second of the cue's sound that the mouth speaks in the middle of each frame, (F,).

        It never goes back. Beside a moved part, over twice its shift, speech is faster or slower
        until it is in step again, or with the next part. What a part is moved over is left out.
        """
        seconds = (np.arange(frames) + 0.5) / float(rate) - self.shift / 1000
        parts = [(start, end, shift / 1000) for start, end, shift in sorted(self.moved)]
        points = [(at, late) for start, end, late in parts for at in (start, end)]
        beyond = [(0.0, -np.inf, 0.0), *parts, (np.inf, 0.0, 0.0)]
        for (_, end, before), (start, _, after) in pairwise(beyond):
            back, on = end + 2 * abs(before), start - 2 * abs(after)
            points += [(at, 0.0) for at in (back, on) if back < on and np.isfinite(at)]
        if not parts:
            return np.asarray(seconds)
        at, late = np.array(sorted(points, key=lambda point: point[0])).T
        shown = np.maximum.accumulate(at + late)
        inside = (seconds > shown[0]) & (seconds < shown[-1])  # beside, to the bit as before
        return np.where(inside, np.interp(seconds, shown, at), seconds)

    def strengths(self, frames: int, rate: Fraction) -> np.ndarray:
        """The strength in each frame of the cue, (F,) float32.

        A key holds for `HELD` on both sides; from there to `AROUND` the line's own strength comes
        back, or the next key's.
        """
        heard = self.heard(frames, rate)
        keys = sorted(self.keys)
        points = [(at + side * HELD, value) for at, value in keys for side in (-1, 1)]
        for (before, _), (after, _) in pairwise([(-np.inf, 0), *keys, (np.inf, 0)]):
            for at in (before + AROUND, after - AROUND):
                if after - before > 2 * AROUND and np.isfinite(at):
                    points.append((at, self.strength))
        if not points:
            return np.full(frames, self.strength, np.float32)
        at, values = np.array(sorted(points)).T
        return np.interp(heard, at, values).astype(np.float32)

    def of_film(self, frames: int, rate: Fraction) -> np.ndarray:
        """Frames of the cue, (F,) bool, in which the face stays the film's own."""
        seconds = (np.arange(frames) + 0.5) / float(rate)
        own = np.zeros(frames, bool)
        for start, end in self.film_mouth:
            own |= (seconds >= start) & (seconds < end)
        return own

    def in_words(self) -> str:
        """``the mouth 80 ms later, strength 0.5: mumbled``; empty without an edit."""
        found = [f"take {self.take}"] if self.take else []
        found += [f"recording {self.audio.name}"] if self.audio else []
        found += [f"the mouth {_late(self.shift)}"] if self.shift else []
        found += [f"{start:g} to {end:g} s {_late(shift)}" for start, end, shift in self.moved]
        found += [f"strength {self.strength:g}"] if self.strength != 1 else []
        found += [self.style] if self.style != AS_SPOKEN else []
        found += [f"{strength:g} at {at:g} s" for at, strength in self.keys]
        found += [f"lips of {self.curves[0].name}"] if self.curves else []
        spans = [f"{start:g} to {end:g} s" for start, end in self.film_mouth]
        found += [f"the film's own mouth from {', '.join(spans)}"] if spans else []
        return ": ".join(part for part in (", ".join(found), self.note) if part)


def _late(ms: float) -> str:
    return f"{abs(ms):g} ms {'later' if ms > 0 else 'earlier'}"


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
    edit: Setting[Edit] = Edit()

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
