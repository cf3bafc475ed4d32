"""One line of a script, and how its times are read."""

import re
from dataclasses import dataclass
from fractions import Fraction

from dubbing.script.timecode import frame_of

CLOCK = re.compile(r"(?:(?:([0-9]{1,3}):)?([0-9]{1,3}):)?([0-9]{1,9}(?:[.,][0-9]{1,9})?)")


@dataclass(frozen=True)
class Line:
    """Spoken words, from when to when, and by whom.

    Attributes:
        number: its place in the file, from 1.
        start, stop: seconds, as written.
        speaker: '' where the file names none.
    """

    number: int
    start: Fraction
    stop: Fraction
    speaker: str
    words: str


def seconds_of(text: str, rate: Fraction, start: int = 0) -> Fraction:
    """Seconds of ``65.5``, ``1:05.5``, ``0:01:05,5`` or the timecode ``00:01:05:12``.

    Args:
        start: frame of the film's first timecode. Timecodes from there on count from it.

    Raises:
        ValueError: it is none of them.
    """
    text = text.strip()
    if text.count(":") == 3 or ";" in text:
        frame = frame_of(text, rate)
        return (frame - start if frame >= start else frame) / rate
    found = CLOCK.fullmatch(text)
    if found is None:
        raise ValueError(f"{text!r:.40} is no time as 65.5, 0:01:05.5 or 00:01:05:12")
    hours, minutes = (int(part or 0) for part in found.groups()[:2])
    return 3600 * hours + 60 * minutes + Fraction(found[3].replace(",", "."))
