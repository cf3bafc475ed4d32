"""Finds the films of a timeline's events, and the frames of them that are used."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from dubbing.engine.disk.files import same_on_disk
from dubbing.engine.disk.numbered import SUFFIXES, plain
from dubbing.errors import ExplainedError
from dubbing.media import MediaInfo
from dubbing.script.timecode import nominal
from dubbing.timelines.reading import Event

NUMBERED = re.compile(rf"(.*?)([0-9]+)({'|'.join(map(re.escape, SUFFIXES))})", re.IGNORECASE)
NEAR = Fraction(1, 50)  # of a frame


@dataclass(frozen=True)
class Shot:
    """Frames of a film that an event uses.

    Attributes:
        first, stop: of the cut; shown: with those of its transitions.
        unit: frames in one of the event's source times.
    """

    film: MediaInfo
    first: int
    stop: int
    shown: tuple[int, int]
    unit: Fraction


class Films:
    """Films by their names, which are those of their files with and without the ending."""

    def __init__(self, paths: Iterable[Path], look: Callable[[Path], MediaInfo]) -> None:
        self._look = look
        self._named: dict[str, list[Path]] = {}
        for path in paths:
            name = plain(path).name
            for key in {*map(same_on_disk, (name, Path(name).stem, stem_of(path)))}:
                self._named.setdefault(key, []).append(path)

    def named_in(self, text: str) -> Iterator[MediaInfo]:
        """The films that are called in a text; those that cannot be read are left out."""
        words = same_on_disk(text)
        named = {
            path: None
            for key, paths in self._named.items()
            if re.search(rf"(?<![^\W_]){re.escape(key)}(?![^\W_])", words)  # shot1 is not in shot10
            for path in paths
        }
        for path in named:
            try:
                info = self._look(path)
            except ExplainedError:
                continue
            if info.picture is not None:
                yield info

    def shot(self, event: Event) -> Shot:
        """The frames of an event.

        Raises:
            ValueError: there is no film for it, or not one alone.
        """
        names = [*event.names, *(Path(name).stem for name in event.names)]
        keys = map(same_on_disk, names)
        paths = next((self._named[key] for key in keys if key in self._named), [])
        found, problems = [], []
        for path in paths:
            try:
                info = self._look(path)
                if info.picture is not None:
                    found.append(shot_of(info, event))
            except (ExplainedError, ValueError) as error:
                problems.append(str(error))
        if len(found) > 1:
            there = " and ".join(str(plain(shot.film.path)) for shot in found)
            raise ValueError(f"found twice, as {there}: rename one, or move it away")
        if not found:
            raise ValueError("; ".join(problems) or f"no film is called {' or '.join(event.names)}")
        return found[0]


def shot_of(film: MediaInfo, event: Event) -> Shot:
    """The frames of a film that an event uses.

    Source times count from the film's timecode. A film without one, and an event that does not lie
    in it, count from where the event's film begins by its own account.

    Raises:
        ValueError: the event does not lie in the film, or begins or ends between its frames.
    """
    alike = nominal(event.rate) == nominal(film.rate)
    unit = Fraction(1) if alike else film.rate / event.rate
    bases = [film.first_frame / unit] if film.timecode else []
    bases += [Fraction(0) if event.base is None else event.base]
    outside = []
    for base in bases:
        at = [(time - base) * unit for time in (event.first, event.stop, *event.shown)]
        first, stop, begin, end = map(round, at)
        if begin < 0 or end > film.frames:
            outside.append(f"frames {first} to {stop} lie outside of {plain(film.path).name}")
        elif any(abs(time - round(time)) > NEAR for time in at):
            rates = f"{float(event.rate):.6g} frames a second, the film {float(film.rate):.6g}"
            raise ValueError(f"it begins or ends between frames: it has {rates}")
        else:
            return Shot(film, first, stop, (begin, end), unit)
    there = f"it has {film.frames}, from {film.timecode or 'no timecode'} on"
    raise ValueError(f"{outside[0]}: {there}")


def stem_of(film: Path) -> str:
    """The name of a film without its ending, and without the number of an image."""
    return re.sub(r"[._-]*#+$", "", plain(film).stem)


def files_under(folder: Path, without: Collection[Path]) -> list[Path]:
    """The files of a folder and of those in it; numbered images as one film each."""
    found: dict[Path, None] = {}
    for path in sorted(folder.rglob("*")):
        hidden = path.name.startswith(".") or any(map(path.is_relative_to, without))
        if hidden or not path.is_file():
            continue
        match = NUMBERED.fullmatch(path.name)
        name = f"{match[1]}{'#' * len(match[2])}{match[3]}" if match else path.name
        found[path.with_name(name)] = None
    return list(found)
