"""Films of numbered files: `shot.####.exr` stands for a file a frame, `shot.1001.exr` and so on.

Such a path goes through all stages like that of a video. How a film is read may follow its name:
`shot.####.exr;rate=24000%2F1001`, `shot.mov;film=LogC4`. So whoever has the path has everything.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from urllib.parse import quote, unquote

SUFFIXES = (".exr", ".dpx", ".tif", ".tiff")
NAME = re.compile(
    r"(?P<before>[^#%;]*)(?P<number>#+|%(?:0(?P<digits>[0-9]))?d)"
    rf"(?P<after>[^#%;]*(?:{'|'.join(SUFFIXES)}))",
    re.IGNORECASE,
)
OPTIONS = re.compile(r"(?P<name>.+?\.\w+)(?P<options>(?:;(?:rate|film|working)=[^;/]*)+)")


@dataclass(frozen=True)
class Numbered:
    """The files of a film, one a frame.

    Attributes:
        folder: where they lie. before, after: their names, before and after the number.
        digits: of a number, at least.
        options: how they are read.
    """

    folder: Path
    before: str
    digits: int
    after: str
    options: dict[str, str] = field(default_factory=dict)

    @property
    def plain(self) -> Path:
        """The path without options, as it is written in a manifest."""
        return self.folder / f"{self.before}{'#' * self.digits}{self.after}"

    def files(self) -> dict[int, Path]:
        """The files that are there, by their numbers in order."""
        one = re.compile(rf"{re.escape(self.before)}([0-9]+){re.escape(self.after)}", re.IGNORECASE)
        try:
            names = os.listdir(self.folder)
        except OSError:
            return {}
        found = {int(match[1]): name for name in names if (match := one.fullmatch(name))}
        return {number: self.folder / found[number] for number in sorted(found)}


@lru_cache(maxsize=1024)
def numbered(path: Path) -> Numbered | None:
    """The files that a path stands for; None where it is one file."""
    name, options = _parted(path)
    match = NAME.fullmatch(name)
    if match is None:
        return None
    hashes = match["number"].startswith("#")
    digits = len(match["number"]) if hashes else int(match["digits"] or 1)
    return Numbered(path.parent, match["before"], digits, match["after"], options)


def is_there(path: Path) -> bool:
    """Whether a path is a file, or stands for some."""
    sequence = numbered(path)
    return bool(sequence.files()) if sequence else plain(path).is_file()


def plain(path: Path) -> Path:
    """A path as a manifest writes it."""
    sequence = numbered(path)
    if sequence is not None:
        return sequence.plain
    name, options = _parted(path)
    return path.with_name(name) if options else path


def options_of(path: Path) -> dict[str, str]:
    """How a film is read, as its path says."""
    return _parted(path)[1]


def with_options(path: Path, options: dict[str, str]) -> Path:
    """The path of a film that says how it is read."""
    if not options:
        return path
    written = ";".join(f"{k}={quote(v, '').replace('.', '%2E')}" for k, v in options.items())
    return Path(f"{plain(path)};{written}")


def _parted(path: Path) -> tuple[str, dict[str, str]]:
    """The name of a file or files, and the options that follow it."""
    match = OPTIONS.fullmatch(path.name)
    if match is None:
        return path.name, {}
    pairs = (one.partition("=") for one in match["options"].split(";") if one)
    return match["name"], {key: unquote(value) for key, _, value in pairs}
