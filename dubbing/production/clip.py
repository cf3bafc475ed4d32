"""Video files of a production."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from dubbing.errors import MediaError
from dubbing.media import MediaInfo
from dubbing.preparation.tracking.portraits import Portrait


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
    """

    name: str = ""
    portraits: tuple[Portrait, ...] = ()
