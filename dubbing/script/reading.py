"""Reads the lines of a script file: SRT, VTT or ASS subtitles, TTML, or CSV."""

import csv
import io
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from dubbing.engine.disk.files import read_text
from dubbing.errors import ExplainedError
from dubbing.script import substation, subtitles, ttml
from dubbing.script.line import (
    LONGEST,
    UNNUMBERED,
    Line,
    OtherKindError,
    is_timecode,
    seconds_of,
)
from dubbing.script.speakers import Names, guessed, is_sound, turns

MOST_BYTES, MOST_LINES = 10 * 10**6, 50_000
COLUMNS = ("in", "out", "speaker", "words")
DELIMITERS = ",;\t"  # of a table; spreadsheets write semicolons where a comma is the decimal sign
NUMBERS = ("cue", "line", "number", "#")  # columns of a table that hold a line's number
# Formats in which a cue without a name may continue the speaker before. In the others, names are a
# field of their own, which is empty where nobody speaks.
CARRIED = (".srt", ".vtt", ".csv", ".tsv")
OVERLAP = Fraction(1, 20)  # seconds by which cues that follow one another may overlap
LONGEST_PAUSE = 10  # seconds, after which a line without a name no longer continues a speaker


def read_lines(path: Path, rate: Fraction, names: Collection[str] | None = ()) -> list[Line]:
    """The lines of a script, in the order of their times.

    Args:
        rate: frames a second of the film, for timecodes.
        names: of speakers in the manifest; None to guess them from the script.

    Raises:
        ExplainedError: it cannot be read, a time in it is invalid, or it has no lines.
    """
    kind = path.suffix.lower()
    if kind not in READERS:
        known = ", ".join(READERS)
        raise ExplainedError(f"no kind of script: {path.suffix!r}", path.name, f"one of {known}")
    try:
        lines = READERS[kind](read_text(path, MOST_BYTES), rate)
    except csv.Error as error:
        remedy = "is every quotation mark closed?"
        raise ExplainedError(f"it is no table: {error}", path.name, remedy) from error
    except (ValueError, OSError) as error:
        raise ExplainedError(str(error), path.name, "correct it there") from error
    if not lines:
        raise ExplainedError("it holds no line", path.name)
    if len(lines) > MOST_LINES:
        what = f"it holds {len(lines)} lines; {MOST_LINES} are read at most"
        raise ExplainedError(what, path.name, "cut it into parts")
    for place, line in enumerate(lines, 1):
        if problem := _problem(line):
            number = place if line.number == UNNUMBERED else line.number
            what = f"line {number} {problem}"
            raise ExplainedError(what, path.name, "correct it there")
    if names is None:
        names = guessed(line.words for line in lines)
    spoken = _numbered(_once(_spoken(lines, Names(names)), rate))
    in_time = sorted(spoken, key=lambda line: line.start)
    return _carried(in_time, continues=kind in CARRIED)


def why_no_script(path: Path) -> str:
    """Why a file with the ending of a script is something else; '' if it may be one.

    Cameras write XML beside their films, and people keep tables of shots there.
    """
    try:
        READERS[path.suffix.lower()](read_text(path, MOST_BYTES), Fraction(25))
    except OtherKindError as error:
        return str(error)
    except (ExplainedError, csv.Error, ValueError, OSError):
        pass  # one with mistakes
    return ""


def _problem(line: Line) -> str:
    if not 0 <= line.start <= LONGEST or line.stop > LONGEST:
        return f"is at {float(line.start):g} s, where no film is"
    if line.stop <= line.start:
        return f"ends at {float(line.stop):g} s, not after its beginning"
    return ""


def _spoken(lines: list[Line], names: Names) -> Iterator[Line]:
    """Lines with the manifest's names; a cue of several speakers becomes several lines."""
    for line in lines:
        words = " ".join(line.words.split())
        if line.speaker:
            yield replace(line, speaker=names.known(line.speaker) or line.speaker, words=words)
            continue
        parts = turns(line.words, names)
        # One speaker, or dashes of an unknown number of people without names.
        shared = line.shared or len({turn.speaker for turn in parts}) > 1
        shared = shared or (len(parts) > 1 and not parts[0].speaker)
        if not shared:
            parts[0].rows = [turn.words for turn in parts]
            parts = parts[:1]
        for turn in parts:
            # A line without a name continues a speaker, but not after a dash or an unknown name.
            unsure = turn.unsure or shared or is_sound(turn.words)
            yield replace(
                line,
                speaker=turn.speaker,
                words=turn.words,
                shared=shared,
                carried=not turn.speaker and not unsure,
            )


def _once(lines: Iterable[Line], rate: Fraction) -> Iterator[Line]:
    """Lines without repetitions of the same words in the same frames, as in layered subtitles."""
    said: dict[tuple[int, int, str], list[Line]] = {}
    for line in lines:
        frames = round(line.start * rate), round(line.stop * rate)
        said.setdefault((*frames, line.words), []).append(line)
    for alike in said.values():
        by_speaker = {line.speaker: line for line in reversed(alike)}
        named = [line for speaker, line in by_speaker.items() if speaker]
        yield from named[::-1] or by_speaker.values()


def _numbered(lines: Iterable[Line]) -> Iterator[Line]:
    """Gives lines without a printed number the place of their cue, which several may share."""
    place, before = 0, None
    for line in lines:
        cue = (line.start, line.stop) if line.shared else None
        place += cue is None or cue != before
        before = cue
        yield replace(line, number=place) if line.number == UNNUMBERED else line


def _carried(lines: list[Line], *, continues: bool) -> list[Line]:
    """Assigns lines without a name to the last speaker, if the script names at least two people.

    Args:
        continues: whether a line without a name may continue a speaker.
    """
    several = continues and len({line.speaker for line in lines} - {""}) > 1
    assigned, speaker, end = [], "", Fraction(0)
    for line in lines:
        # Nobody speaks two lines at a time: it is a sign, or another person.
        beside = not line.speaker and line.start < end - OVERLAP
        near = line.start - end <= LONGEST_PAUSE and not beside
        if line.carried and several and speaker and near:
            assigned.append(replace(line, speaker=speaker))
        else:
            assigned.append(replace(line, carried=False))
            if not is_sound(line.words) and not beside:
                speaker = "" if line.shared else line.speaker
        end = max(end, line.stop)
    return assigned


def _table(text: str, rate: Fraction) -> list[Line]:
    head = text.partition("\n")[0]
    sign = max(DELIMITERS, key=head.count)
    written = io.StringIO(text, newline=None)
    plain = sign == "\t" and not _quoted(text)
    rows = csv.DictReader(
        written,
        delimiter=sign,
        quoting=csv.QUOTE_NONE if plain else csv.QUOTE_MINIMAL,
        skipinitialspace=True,
        strict=True,
    )
    given = [name.strip().lower() for name in rows.fieldnames or ()]
    if missing := [name for name in COLUMNS if name not in given]:
        wanted = ", ".join(COLUMNS)
        raise OtherKindError(f"its first row names no column {missing[0]}: it needs {wanted}")
    rows.fieldnames = given
    numbered = next((name for name in NUMBERS if name in given), "")
    lines = []
    for place, row in enumerate(rows, 1):
        if not "".join(row[name] or "" for name in COLUMNS).strip():
            continue  # spreadsheets write empty rows below a table
        if any(row.get(None, ())):  # type: ignore[call-overload]
            raise ValueError(f"line {place} has more cells than columns: put its words in quotes")
        times = [row[name] or "" for name in ("in", "out")]
        try:
            begin, end = (seconds_of(time, rate) for time in times)
            number = _number((row.get(numbered) or "").strip())
        except ValueError as error:
            raise ValueError(f"line {place}: {error}") from error
        speaker, words = ((row[name] or "").strip() for name in ("speaker", "words"))
        kind = {"counted": any(map(is_timecode, times)), "drops": ";" in "".join(times)}
        lines.append(Line(number, begin, end, speaker, words, **kind))
    return lines


def _quoted(text: str) -> bool:
    """Whether quotation marks enclose cells between tabs, and are no words.

    Some spreadsheets write all as it is between tabs. A quotation from one line to another would
    then be taken for a cell, with tabs in it.
    """
    try:
        cells = csv.reader(io.StringIO(text, newline=None), delimiter="\t", strict=True)
        return not any("\t" in cell for row in cells for cell in row)
    except csv.Error:
        return False


def _number(text: str) -> int:
    """A line's number in a table: ``7``, ``7.`` or, as spreadsheets write it, ``7.0``.

    Raises:
        ValueError: it is none; its place in the file may be another line's number.
    """
    if not text:
        return UNNUMBERED
    whole = text.removesuffix("0").removesuffix(".") if "." in text else text
    if not subtitles.PRINTED.fullmatch(whole):
        raise ValueError(f"{text!r:.40} is no number of a line as 7")
    return int(whole)


READERS: dict[str, Callable[[str, Fraction], list[Line]]] = {
    ".srt": subtitles.read,
    ".vtt": subtitles.read,
    ".ass": substation.read,
    ".ssa": substation.read,
    ".ttml": ttml.read,
    ".dfxp": ttml.read,
    ".xml": ttml.read,
    ".csv": _table,
    ".tsv": _table,
}
