"""The text of an EDL (CMX3600), before and after OpenTimelineIO reads it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

# A row of an EDL that gives the speed of an event, frames a second; another word to keep it by.
SPEED, SPEED_KEPT = "M2 ", "SPEED "
FORWARDS, NEAR_RATE = re.compile(r"[0-9]{1,4}(\.[0-9]{1,6})?"), 0.1  # after the point is one digit
TIMECODE = re.compile(r"\b([0-9]{2})([:;])([0-9]{2})\2([0-9]{2})([:;])([0-9]{2})\b")
DROPPED = re.compile(r"\b[0-9]{2}:[0-9]{2}:[0-9]{2};[0-9]{2}\b")
SOURCE = re.compile(r"\* *SOURCE FILE:")
# An event that is faded in from black: a row of black, its own row, and comments.
FADED_IN = re.compile(
    r"^ *([0-9]+) +BL .*\n *(\1 +\S+ +\S+) +[DW][0-9]* +[0-9]+ (.*)((?:\n(?! *[0-9]).*)*)", re.M
)
FROM, TO = "FROM CLIP NAME:", "TO CLIP NAME:"
# A row of an event, and the tracks that its third word names.
ROW = re.compile(r"\s*([0-9]+)\s+(\S+)\s+(\S+)\s+(C\s.*\S)\s*")
TRACKS = {"V": "V", "A": "1", "A2": "2", "AA": "12", "B": "V1", "A2/V": "V2", "AA/V": "V12"}


def plain(text: str, *, drops: bool = False) -> str:
    """An EDL whose events, files, locators and speeds are read.

    Locators and speeds are not, with the semicolon of drop-frame timecode, nor an event of a row
    for each of its tracks, nor timecodes of semicolons alone. That frames are dropped may stand
    above the events instead.

    Nor is a fade from black where a track begins: it becomes a cut, as a dub has no black to mix.

    Speeds stand in it twice: the adapter forgets one if the event is as long as its source, and
    keeps comments that it does not know.

    Args:
        drops: whether the timecode of its films is drop-frame.
    """
    text = TIMECODE.sub(r"\1:\3:\4\5\6", text)
    modes = {row.split(":")[1].strip() for row in text.splitlines() if row.startswith("FCM:")}
    if drops and modes == {"DROP FRAME"} and not dropped(text):
        text = TIMECODE.sub(r"\1:\3:\4;\6", text)
    text = FADED_IN.sub(_cut_in, text)
    rows: list[str] = []
    for row in SOURCE.sub("* FROM FILE:", text).splitlines():
        rows.append(row.replace(";", ":", 3) if row.startswith(("* LOC:", SPEED)) else row)
        rows += [f"* {row.strip()}".replace(SPEED, SPEED_KEPT)] if row.startswith(SPEED) else []
        if len(rows) > 1 and (event := _of_all_tracks(*rows[-2:])):
            rows[-2:] = [event]
    return "\n".join(rows)


def _cut_in(event: re.Match[str]) -> str:
    """The text of an event that is faded in from black, as a cut with the name of what it shows."""
    comments = event[4].split("\n")
    if any(TO in row for row in comments):
        comments = [row.replace(TO, FROM) for row in comments if FROM not in row]
    return "\n".join([f"{event[2]} C {event[3]}", *comments[1:]])


def dropped(text: str) -> bool:
    """Whether there is a drop-frame timecode in the text of an EDL."""
    return DROPPED.search(text) is not None


def _of_all_tracks(*rows: str) -> str:
    """Two rows of one event, of the same times on different tracks, as one; else ''."""
    one, other = map(ROW.fullmatch, rows)
    if not one or not other or one.group(1, 2, 4) != other.group(1, 2, 4):
        return ""
    tracks = {*TRACKS.get(one[3], ""), *TRACKS.get(other[3], "")}
    codes = [code for code, its in TRACKS.items() if {*its} == tracks]
    return " ".join([one[1], one[2], *codes, one[4]]) if codes else ""


def changes_speed(metadata: Mapping[str, Any], rate: float) -> bool:
    """Whether an event is shown at another speed, or backwards, by what `plain` kept.

    Args:
        metadata: of its clip.
        rate: frames a second of its source.
    """
    for comment in map(str, metadata.get("cmx_3600", {}).get("comments", ())):
        if comment.startswith(SPEED_KEPT):
            speed = comment.split()[-2]  # the last is a timecode
            if not FORWARDS.fullmatch(speed) or abs(float(speed) - rate) > NEAR_RATE:
                return True
    return False
