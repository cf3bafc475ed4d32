"""Timecodes HH:MM:SS:FF, and their frames.

A timecode counts frames as if there were a whole number of them a second. At 30000/1001 a second
and its multiples it may skip numbers (drop frame, written with a semicolon), so that it keeps up
with the clock; no frame is skipped.
"""

import re
from fractions import Fraction

WRITTEN = re.compile(r"([0-9]{1,2}):([0-5][0-9]):([0-5][0-9])([:;.])([0-9]{2,3})")
DAY = 24  # hours, after which timecodes start again


def nominal(rate: Fraction) -> int:
    """Timecodes a second: 24 at 24000/1001."""
    return round(rate)


def can_drop(rate: Fraction) -> bool:
    """Whether there are drop-frame timecodes at this rate."""
    return rate.denominator == 1001 and nominal(rate) % 30 == 0


def frame_of(timecode: str, rate: Fraction) -> int:
    """Number of the frame from 00:00:00:00 on.

    Raises:
        ValueError: it is no timecode at that rate.
    """
    text = timecode.strip()
    if text.count(";") == 3:  # as Premiere writes drop frame
        text = text.replace(";", ":", 2)
    match = WRITTEN.fullmatch(text)
    if match is None or match[4] == ".":
        raise ValueError(f"{timecode!r} is no timecode as 01:00:00:00")
    hours, minutes, seconds, frames = (int(match[k]) for k in (1, 2, 3, 5))
    drop, each = match[4] == ";", nominal(rate)
    if frames >= each:
        raise ValueError(f"{timecode!r} has frame {frames}, but there are {each} a second")
    left_out = each // 15
    if drop and not can_drop(rate):
        raise ValueError(f"{timecode!r} drops frames, which nothing at {rate} a second does")
    if drop and frames < left_out and not seconds and minutes % 10:
        raise ValueError(f"{timecode!r} is left out of drop-frame timecode")
    number = ((hours * 60 + minutes) * 60 + seconds) * each + frames
    passed = hours * 60 + minutes
    return number - left_out * (passed - passed // 10) if drop else number


def timecode_of(frame: int, rate: Fraction, *, drop: bool = False) -> str:
    """The timecode of a frame; the inverse of `frame_of`."""
    each = nominal(rate)
    if drop:
        left_out = each // 15
        minute, ten = 60 * each - left_out, 600 * each - 9 * left_out
        tens, rest = divmod(frame, ten)
        minutes = 0 if rest < 60 * each else 1 + (rest - 60 * each) // minute
        frame += left_out * (9 * tens + minutes)
    seconds, frames = divmod(frame, each)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    digits = max(2, len(str(each - 1)))
    mark = ";" if drop else ":"
    return f"{hours % DAY:02d}:{minutes:02d}:{seconds:02d}{mark}{frames:0{digits}d}"
