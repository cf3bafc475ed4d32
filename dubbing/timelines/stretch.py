"""Stretches of film that a cut uses, as entries of a manifest: a dub each."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap

from dubbing.engine.disk.files import seen_from
from dubbing.engine.disk.numbered import plain
from dubbing.errors import ExplainedError
from dubbing.media import probe
from dubbing.script.timeline import first_frame, frame_count
from dubbing.timelines.films import Shot, stem_of

AGAIN = ("", *(f"_{k}" for k in range(2, 1000)))  # ends of names of one film and frame


@dataclass
class Stretch:
    """The entry of a dub that shows frames first .. stop of a film.

    Attributes:
        lines: whether it has lines of its own, for all of the film.
        events: numbers of those that it is laid over.
    """

    entry: Any
    film: Path
    rate: Fraction
    first: int
    stop: int
    lines: bool = False
    events: list[int] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The name of the dub."""
        return str(self.entry.get("name"))

    def holds(self, shot: Shot) -> bool:
        """Whether all frames of a shot are among its own."""
        first, stop = shot.shown
        return self.film == plain(shot.film.path) and self.first <= first and stop <= self.stop


def new(shot: Shot, handles: int, folder: Path, person: str, taken: set[str]) -> Stretch:
    """The stretch of a shot.

    Args:
        handles: further frames, before and after.
        taken: names of other dubs.
    """
    rate, film = shot.film.rate, plain(shot.film.path)
    first, stop = max(0, shot.shown[0] - handles), min(shot.film.frames, shot.shown[1] + handles)
    tried = (f"{stem_of(film)[:60]}_{first:06d}{again}" for again in AGAIN)
    name = next(name for name in tried if name not in taken)
    entry = CommentedMap(name=name, identity=person, clip=seen_from(folder, film))
    entry["video_start"] = number(first / rate)
    entry["audio"] = ""
    entry["audio_seconds"] = number((stop - first) / rate)
    entry.fa.set_flow_style()
    return Stretch(entry, film, rate, first, stop)


def read(document: Any, folder: Path) -> Iterator[Stretch]:
    """The stretches of a manifest."""
    defaults = document.get("defaults") or {}
    for entry in document.get("dubs") or []:
        keys = {**defaults, **entry}
        people = keys.get("speakers") or {"": keys.get("identity")}
        person = document["identities"].get(next(iter(people.values()))) or {}
        clip = keys.get("clip") or person.get("clip") or next(iter(person.get("clips") or [""]))
        path = placed(folder, clip)
        try:
            film = probe(path)
            first = first_frame(float(keys.get("video_start") or 0), film.rate)
            seconds = float(keys.get("audio_seconds") or 0)
        except (ExplainedError, ValueError):
            continue  # no event lies in it
        if keys.get("lines"):
            yield Stretch(entry, path, film.rate, 0, film.frames, lines=True)
        elif seconds:
            stop = min(film.frames, first + frame_count(seconds, film.rate))
            yield Stretch(entry, path, film.rate, first, stop)


def number(seconds: Fraction) -> float | int:
    """Seconds as they are written: to the microsecond."""
    rounded = round(float(seconds), 6)
    return int(rounded) if rounded.is_integer() else rounded


def placed(folder: Path, clip: object) -> Path:
    """The path that a manifest in a folder names; of a link the link, which has the clip's name."""
    return Path(os.path.normpath(folder / str(clip)))
