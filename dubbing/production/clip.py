"""Video files of a production."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from dubbing.errors import MediaError
from dubbing.media import MediaInfo
from dubbing.preparation.tracking.portraits import Portrait

PART_SECONDS = 60  # a part of a clip begins and ends at a multiple of them
BESIDE_SECONDS = 2  # at least, of a part, before and after what it is for


@dataclass(frozen=True)
class Clip:
    """A video file: a clip of a person, or the film of a dub.

    Attributes:
        info: None where the file is damaged, or was not probed.
        damaged: why it cannot be read.
    """

    path: Path
    info: MediaInfo | None = None
    damaged: MediaError | None = None

    @property
    def probed(self) -> MediaInfo:
        """Facts of a file that is not damaged.

        Raises:
            MediaError: it is.
        """
        if self.info is None:
            raise self.damaged or MediaError("was not probed", str(self.path))
        return self.info

    @property
    def rate(self) -> Fraction:
        """Frames a second."""
        return self.probed.rate

    @property
    def frames(self) -> int:
        """Number of frames; 0 of a damaged file."""
        return self.info.frames if self.info else 0


@dataclass(frozen=True)
class PersonClip(Clip):
    """A clip of a person.

    Attributes:
        name: in the names of its stages; '' for the first one that the person is learned from.
        portraits: the person, then the others in the clip, to tell them apart; empty where the
            person has the largest face.
        part: the only frames, first .. stop, that are prepared; None for all.
    """

    name: str = ""
    portraits: tuple[Portrait, ...] = ()
    part: tuple[int, int] | None = None

    @property
    def used_frames(self) -> int:
        """Number of the frames that are prepared."""
        return self.frames if self.part is None else self.part[1] - self.part[0]

    @property
    def used_seconds(self) -> tuple[int, int]:
        """From which second to which it is prepared; the end of the clip is rounded up."""
        first, stop = self.part or (0, self.frames)
        return round(first / self.rate), math.ceil(stop / self.rate)

    def part_with(self, start: float, end: float) -> PersonClip:
        """The part with these seconds, of whole minutes; all of a clip of less than two."""
        if self.info is None or self.frames < 2 * PART_SECONDS * self.rate:
            return self
        low = max(0, math.floor((start - BESIDE_SECONDS) / PART_SECONDS))
        high = math.ceil((end + BESIDE_SECONDS) / PART_SECONDS)
        first, stop = (math.floor(at * PART_SECONDS * self.rate) for at in (low, high))
        stop = min(stop, self.frames)
        if first >= stop or (first, stop) == (0, self.frames):
            return self
        return replace(self, part=(first, stop))
