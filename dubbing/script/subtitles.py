"""Reads cues of SRT and VTT: the printed number, two times, and rows of words with markup.

pysubs2 drops the printed numbers, mistakes a last row of digits for one, and its patterns take
quadratic time for a long text.
"""

import html
import re
from dataclasses import dataclass, field, replace
from fractions import Fraction

from dubbing.script.line import CLOCK, UNNUMBERED, Line, seconds_of

# Word processors make one sign of the arrow `-->`, or of its dashes.
ARROW = re.compile("[-\u2010-\u2015\u2212]{1,2}>|\u2192")
TIMED = re.compile("[0-9]+:[0-9]+:[0-9]")  # begins a row of times, and hardly one of words
SKIPPED = ("NOTE", "STYLE", "REGION", "WEBVTT")  # blocks of VTT without words
SETTING = re.compile(r"[A-Za-z]\w*:\S+")  # `align:start`, or the place of a picture: `X1:100`
PRINTED = re.compile(r"[0-9]{1,9}")
TAG = re.compile(r"(<[\w/.][^<>]*>|\{[^{}]*\})")  # tags do not nest: linear time
HOLD = Fraction(1, 50)  # seconds
BREAK = re.compile(r"<br\s*/?>", re.IGNORECASE)


@dataclass
class _Cue:
    """A cue: the row above its times, the two times, and the rows of words below."""

    name: str
    times: tuple[str, str]
    rows: list[str] = field(default_factory=list)


def read(text: str, rate: Fraction) -> list[Line]:
    """The cues; one with several voices becomes a line for each of them.

    Raises:
        ValueError: a row in the position of times has none.
    """
    lines: list[Line] = []
    for cue in _cues(text):
        start, stop = (seconds_of(part, rate) for part in cue.times)
        name = cue.name.strip("#.")  # as word processors number
        number = int(name) if PRINTED.fullmatch(name) else UNNUMBERED
        # ffmpeg writes the hard space of ASS, also of closed captions, as it is.
        voices = voices_of("\n".join(cue.rows).replace(r"\h", " "))
        shared = len({voice for voice, _ in voices}) > 1
        lines += [Line(number, start, stop, voice, words, shared=shared) for voice, words in voices]
    return _unrolled(lines)


def _unrolled(lines: list[Line]) -> list[Line]:
    """Lines without the rows that rolling captions, as YouTube's, show again.

    A cue of a hundredth of a second holds the last row before it moves up in the next cue.
    """
    kept: list[Line] = []
    last, held, end = "", "", Fraction(-1)
    for line in lines:
        rows = line.words.split("\n")
        touches = line.start == end
        end = line.stop
        if touches and line.stop - line.start <= HOLD and rows == [last]:
            held = last
            continue
        if touches and held and rows[0] == held:
            rows.pop(0)
        if rows:
            kept.append(replace(line, words="\n".join(rows)))
            last = rows[-1]
        held = ""
    return kept


def _cues(text: str) -> list[_Cue]:
    cues: list[_Cue] = []
    above, begins, skipped = "", True, False  # begins: the row above begins a block
    alone = ""  # the last row, between empty ones: a number, where every row is followed by one
    for end in ("\r\r\n", "\r\n", "\r"):  # the first is the second, converted once more
        text = text.replace(end, "\n")
    rows = text.split("\n")
    for place, row in enumerate(map(str.strip, rows), 1):
        # Times are at the beginning of a block, or below its name.
        expected = not above or begins or bool(PRINTED.fullmatch(above))
        timed = _times(row)
        if timed is not None:
            times, words = timed
            name = above if expected else ""
            if _follows(alone, cues):
                name = alone
            if cues and name and cues[-1].rows[-1:] == [name]:
                cues[-1].rows.pop()
            cues.append(_Cue(name, times, [words] * bool(words)))
            skipped = False
        elif expected and not skipped and ("-->" in row or TIMED.match(row)):
            raise ValueError(f"row {place}: no times as 00:01:05,500 --> 00:01:07,000")
        else:
            if not above:
                skipped = row.split(" ")[0] in SKIPPED
            if cues and row and not skipped:
                cues[-1].rows.append(row)
        if row:
            alone = ""
        elif above and begins:
            alone = above
        above, begins = row, not above
    return cues


def _follows(row: str, cues: list[_Cue]) -> bool:
    """Whether a row holds a number, and one after that of the last cue."""
    rows = [cue.name for cue in cues[-1:]] + [row]
    return all(map(PRINTED.fullmatch, rows)) and (len(rows) == 1 or int(rows[0]) < int(row))


def _times(row: str) -> tuple[tuple[str, str], str] | None:
    """The two times of a row, as written, and words that follow them; settings are none."""
    first, *after = ARROW.split(row, 1)
    second, *rest = "".join(after).split(maxsplit=1) or [""]
    parts = first.strip(), second
    words = "".join(rest)
    if all(map(SETTING.fullmatch, words.split())):
        words = ""
    well = all(":" in part and CLOCK.fullmatch(part) for part in parts)
    return (parts, words) if well else None


def voices_of(text: str) -> list[tuple[str, str]]:
    """The parts of a text by the voice of their tag (``<v Anna>``), '' without; without markup."""
    parts: list[list[str]] = [["", ""]]
    for place, piece in enumerate(TAG.split(text)):
        if place % 2 == 0:
            parts[-1][1] += piece
        elif BREAK.fullmatch(piece):
            parts[-1][1] += "\n"
        elif (voice := _voice(piece)) and voice != parts[-1][0]:
            parts.append([voice, ""])
    spoken = [(voice, html.unescape(words).strip()) for voice, words in parts]
    return [part for part in spoken if part[1]] or [(parts[-1][0], "")]


def _voice(tag: str) -> str:
    """The voice that a tag names; '' for other tags."""
    name, *rest = tag[1:-1].split(maxsplit=1) or [""]
    named = tag[0] == "<" and rest and name.split(".", 1)[0] == "v"
    return " ".join(html.unescape(rest[0]).split()) if named else ""
