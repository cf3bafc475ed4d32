"""How the mouth of a line differs from what its speech asks for, as an editor wants it.

F frames of the line.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from dubbing.engine.graph.fields import Setting

HELD, AROUND = 0.04, 0.12  # s beside a key: its strength holds, and has gone
AS_SPOKEN = "as spoken"
# See `sound_to_lips.speech_frames.styled`.
STYLES = {AS_SPOKEN: 0.0, "softer": -1.0, "clearer": 1.0}


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
