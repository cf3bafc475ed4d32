"""Rendered heads of a cue, the files that hold them, and the faces that they replace.

S side of the crop in px.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.errors import RenderingError
from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.prepared import PreparedClip
from dubbing.video.own_pixels import ASKED


@dataclass(frozen=True)
class Heads:
    """Rendered heads of a cue, of frames first .. stop of the dub.

    Attributes:
        read: gives so many (S, S, 4) uint8, from a first one of the cue on.
        clip: under them, of which every dub has one a person.
        kept: (T,) numbers of the reasons why its frames keep their own face; see `own_pixels`.
        name: of the cue.
        asked: (stop - first,) frames whose face an edit leaves to the film; () for none.
        made_of: digests of what so many heads from a first one on are read from.
    """

    read: Callable[[int, int], Iterator[np.ndarray]]
    clip: PreparedClip
    first: int
    stop: int
    kept: np.ndarray
    name: str = ""
    asked: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    made_of: Callable[[int, int], list[str]] = lambda _first, _count: []

    def why_kept(self, poses: np.ndarray) -> np.ndarray:
        """Numbers (F,) of the reasons why frames of the dub keep the film's face; 0: they do not.

        Args:
            poses: (F,) frames of the film under the cue.
        """
        kept = self.kept[poses]
        return np.where(self.asked[: len(poses)], ASKED, kept) if len(self.asked) else kept


@dataclass(frozen=True)
class Face:
    """A face in a frame of the film, the rendered head, and how much of it is shown.

    Attributes:
        beside: the heads of the frames before and after, where they are needed.
    """

    clip: PreparedClip
    film: FilmFrame
    head: np.ndarray
    share: float
    beside: tuple[np.ndarray | None, np.ndarray | None] = (None, None)


def files_of_heads(folder: Path, first: int, count: int) -> Iterator[tuple[int, Path]]:
    """The files of a folder that hold heads first .. first + count, with their first frames."""
    for start, path in sorted((int(path.stem), path) for path in folder.glob("*.mkv")):
        if start < first + count and first < start + media.probe(path).frames:
            yield start, path


def read_heads(folder: Path, first: int, count: int) -> Iterator[np.ndarray]:
    """Heads (S, S, 4) uint8 of frames first .. first + count, of FFV1 RGBA files in a folder.

    Files bear their first frame.

    Raises:
        RenderingError: there are not so many.
    """
    given = 0
    for start, path in files_of_heads(folder, first, count):
        skip = max(0, first - start)
        for head in media.read_frames(path, start=skip, count=count - given, pixels="rgba"):
            yield head
            given += 1
    if given < count:
        raise RenderingError(
            f"{given} heads instead of {count} from frame {first} on",
            str(folder),
            "run again with --force render",
        )
