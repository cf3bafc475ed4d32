"""The lines of a script file: SRT, VTT or ASS subtitles, TTML, or CSV."""

import csv
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pysubs2

from dubbing.errors import DubbingError
from dubbing.files import read_bounded
from dubbing.script import ttml
from dubbing.script.line import Line, seconds_of

MOST_BYTES = 10 * 10**6
COLUMNS = ("in", "out", "speaker", "words")
ARROW = "-->"
# <v Anna>Good evening</v>, and [ANNA] Good evening or ANNA: Good evening
VOICE = re.compile(r"<v(?:\.[^\s>]*)*\s+([^>]+)>")
TAG = re.compile(r"<[^>]*>|\{[^}]*\}")
NAMED = re.compile(r"(?:-\s*)?(?:\[([^\]\n]{1,40})\]:?|([^\s:\[\]][^:\n\[\]]{0,39}):(?=\s))\s*")


def read_lines(path: Path, rate: Fraction, start: int = 0) -> list[Line]:
    """The lines of a script, in the order of the file.

    Subtitles have speakers as ``<v Anna>`` (VTT), as the actor (ASS), or before the words:
    ``ANNA: Good evening``, ``[ANNA] Good evening``.

    Args:
        rate: frames a second of the film, for timecodes.
        start: frame of the film's first timecode.

    Raises:
        DubbingError: it cannot be read, a time in it is none, or it holds no line.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(READERS)
        raise DubbingError(f"no kind of script: {path.suffix!r}", path.name, f"one of {known}")
    try:
        text = read_bounded(path, MOST_BYTES).decode("utf-8-sig")
        lines = reader(text, rate, start)
    except UnicodeDecodeError as error:
        raise DubbingError("it is not UTF-8", path.name, "save it as UTF-8") from error
    except (ValueError, OSError, csv.Error) as error:
        raise DubbingError(str(error), path.name, "correct it there") from error
    if not lines:
        raise DubbingError("it holds no line", path.name)
    for line in lines:
        if line.stop <= line.start:
            what = f"line {line.number} ends at {float(line.stop):g} s, not after its beginning"
            raise DubbingError(what, path.name, "correct it there")
    return lines


def _subtitles(text: str, _rate: Fraction, _start: int) -> list[Line]:
    try:
        events = pysubs2.SSAFile.from_string(text, keep_html_tags=True).events
    except (pysubs2.Pysubs2Error, ValueError, AttributeError) as error:
        raise ValueError("no subtitles can be read from it") from error
    events = [event for event in events if event.type == "Dialogue"]
    if ARROW in text and text.count(ARROW) != len(events):
        number = _first_odd_time(text)
        raise ValueError(f"row {number}: no times as 00:01:05,500 --> 00:01:07,000")
    lines = []
    for number, event in enumerate(events, 1):
        speaker, words = _speaker(event.text.replace(r"\N", "\n").replace(r"\n", "\n"))
        start, stop = Fraction(event.start, 1000), Fraction(event.end, 1000)
        lines.append(Line(number, start, stop, event.name.strip() or speaker, words))
    return lines


def _speaker(text: str) -> tuple[str, str]:
    """The speaker, if the text names one, and the words alone."""
    voice = VOICE.search(text)
    words = TAG.sub("", text).strip()
    if voice:
        return voice[1].strip(), " ".join(words.split())
    named = NAMED.match(words)
    if named:
        return (named[1] or named[2]).strip(), " ".join(words[named.end() :].split())
    return "", " ".join(words.split())


def _first_odd_time(text: str) -> int:
    """Number of the first row whose arrow stands between other things than two times."""
    stamp = r"(?:\d+:)?\d{1,2}:\d{2}[.,]\d{1,3}"
    good = re.compile(rf"\s*{stamp}\s*{ARROW}\s*{stamp}.*")
    rows = enumerate(text.splitlines(), 1)
    return next((k for k, row in rows if ARROW in row and not good.fullmatch(row)), 1)


def _table(text: str, rate: Fraction, start: int) -> list[Line]:
    rows = csv.DictReader(text.splitlines(), skipinitialspace=True)
    given = [name.strip().lower() for name in rows.fieldnames or ()]
    if missing := [name for name in COLUMNS if name not in given]:
        wanted = ", ".join(COLUMNS)
        raise ValueError(f"its first row names no column {missing[0]}: it needs {wanted}")
    rows.fieldnames = given
    lines = []
    for number, row in enumerate(rows, 1):
        try:
            begin, end = (seconds_of(row[name] or "", rate, start) for name in ("in", "out"))
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from error
        speaker, words = ((row[name] or "").strip() for name in ("speaker", "words"))
        lines.append(Line(number, begin, end, speaker, words))
    return lines


READERS: dict[str, Callable[[str, Fraction, int], list[Line]]] = {
    ".srt": _subtitles,
    ".vtt": _subtitles,
    ".ass": _subtitles,
    ".ttml": ttml.read,
    ".dfxp": ttml.read,
    ".xml": ttml.read,
    ".csv": _table,
}
