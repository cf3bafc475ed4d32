"""Reads the dialogue of an ASS or SSA file, without comments and drawings.

pysubs2 handles drawings, too, but takes quadratic time for a text of many overrides.
"""

import io
import re
from collections.abc import Iterator
from fractions import Fraction

from dubbing.script.line import UNNUMBERED, Line, seconds_of

FIELDS = "Layer, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text"
OVERRIDE = re.compile(r"(\{[^{}]*\})")
DRAWING = re.compile(r"\\p([0-9])")


def read(text: str, rate: Fraction) -> list[Line]:
    """The dialogue, a line an event; the speaker is the actor.

    Raises:
        ValueError: an event has no times.
    """
    lines = []
    for place, event in _events(text):
        words = spoken(event["text"])
        if not words:
            continue
        try:
            start, stop = (seconds_of(event[key], rate) for key in ("start", "end"))
        except (KeyError, ValueError) as error:
            raise ValueError(f"row {place}: no times as 0:01:05.50,0:01:07.00") from error
        speaker = event.get("name", event.get("actor", "")).strip()
        lines.append(Line(UNNUMBERED, start, stop, speaker, words))
    return lines


def _events(text: str) -> Iterator[tuple[int, dict[str, str]]]:
    """The fields of each event of dialogue, by their names, and its row."""
    names, section = _named(FIELDS), ""
    for place, row in enumerate(io.StringIO(text, newline=None), 1):
        kind, _, rest = row.partition(":")
        if row.startswith("["):
            section = row.strip().casefold()
        elif section == "[events]" and kind == "Format":
            names = _named(rest)
        elif section == "[events]" and kind == "Dialogue":
            values = rest.strip().split(",", len(names) - 1)
            yield place, {"text": "", **dict(zip(names, values, strict=False))}


def _named(fields: str) -> list[str]:
    return [name.strip().casefold() for name in fields.split(",")]


def spoken(text: str) -> str:
    r"""The words of an event's text, without overrides and drawings (``{\p1}``)."""
    words, drawing = [], False
    for place, piece in enumerate(OVERRIDE.split(text)):
        if place % 2:
            scales = DRAWING.findall(piece)
            drawing = int(scales[-1]) > 0 if scales else drawing
        elif not drawing:
            words.append(piece)
    return "".join(words).replace(r"\N", "\n").replace(r"\n", "\n").replace(r"\h", " ").strip()
