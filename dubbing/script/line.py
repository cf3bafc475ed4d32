"""One line of a script, and the parsing of its times."""

import re
from dataclasses import dataclass
from fractions import Fraction

from dubbing.script.timecode import frame_of

LONGEST = 10**9  # seconds
UNNUMBERED = -1  # the number of a line without a printed one, until all of the file is read
CLOCK = re.compile(r"(?:(?:([0-9]{1,3}):)?([0-9]{1,3}):)?([0-9]{1,9}(?:[.,][0-9]{1,9})?)")


class OtherKindError(ValueError):
    """A file has the ending of a script, and is something else."""


@dataclass(frozen=True)
class Line:
    """Spoken words with their times and speaker.

    Attributes:
        number: as printed in the file, else the position of its cue there, from 1.
        start, stop: seconds, as written.
        speaker: '' where the file names none.
        counted: whether its times are timecodes, which count frames.
        shared: whether another person speaks in the same cue.
        carried: whether it names nobody, and is assigned to the speaker before it.
        drops: whether its timecodes are drop-frame.
    """

    number: int
    start: Fraction
    stop: Fraction
    speaker: str
    words: str
    counted: bool = False
    shared: bool = False
    carried: bool = False
    drops: bool = False


def is_timecode(text: str) -> bool:
    """Whether a written time is a timecode, which counts frames."""
    return text.count(":") == 3 or ";" in text


def seconds_of(text: str, rate: Fraction) -> Fraction:
    """Seconds of ``65.5``, ``1:05.5``, ``0:01:05,5`` or the timecode ``00:01:05:12``.

    Raises:
        ValueError: it is none of them.
    """
    text = text.strip()
    if is_timecode(text):
        return frame_of(text, rate) / rate
    match = CLOCK.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r:.40} is no time as 65.5, 0:01:05.5 or 00:01:05:12")
    hours, minutes = (int(part or 0) for part in match.groups()[:2])
    return 3600 * hours + 60 * minutes + Fraction(match[3].replace(",", "."))
