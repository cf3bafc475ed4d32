"""A film at half size whose frames are kept in memory once they were read."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields

import numpy as np

from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.halved import HalvedClip

MOST_KEPT = 800 * 10**6  # bytes


@dataclass(frozen=True, kw_only=True)
class KeptFilm(HalvedClip):
    """A halved clip that is read once.

    Attributes:
        kept: frames by number, the oldest first. Several threads read and add.
    """

    kept: OrderedDict[int, FilmFrame] = field(default_factory=OrderedDict)

    def film_frames(self, start: int = 0, count: int | None = None) -> Iterator[FilmFrame]:
        """See `PreparedClip.film_frames`."""
        stop = len(self) if count is None else min(start + count, len(self))
        while start < stop:
            if (known := self.kept.get(start)) is not None:
                yield known
                start += 1
                continue
            first = start
            until = next((k for k in range(first, stop) if k in self.kept), stop)
            for frame in super().film_frames(first, until - first):
                self._keep(start, frame)
                yield frame
                start += 1
            if start < until:  # the film ends early; whoever reads on says so
                return

    def whole_frames(self, start: int = 0, count: int | None = None) -> Iterator[np.ndarray]:
        """See `PreparedClip.whole_frames`."""
        return (frame.whole for frame in self.film_frames(start, count))

    def _keep(self, number: int, frame: FilmFrame) -> None:
        self.kept[number] = frame
        if len(self.kept) > 1 and len(self.kept) * size_of(frame) > MOST_KEPT:
            with suppress(KeyError):
                self.kept.popitem(last=False)


def size_of(frame: FilmFrame) -> int:
    """Bytes of a frame."""
    parts = (getattr(frame, one.name) for one in fields(frame))
    return sum(part.nbytes for part in parts if part is not None)
