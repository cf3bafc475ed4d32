"""Writes markers as an edit decision list (CMX3600): an event and a locator a line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

MOST_EVENTS = 999  # numbers of three digits; an editor takes no more in one list
LONGEST_NOTE = 120  # characters
Timecode = Callable[[int], str]


@dataclass(frozen=True)
class Marker:
    """Frames first .. stop of a film, a colour and a note on them."""

    first: int
    stop: int
    colour: str
    note: str


def edl(title: str, markers: Sequence[Marker], timecode: Timecode, *, drop: bool) -> str:
    """The list as text.

    The note is in a locator, as Avid and Premiere write it, and in a comment that Resolve reads.

    Args:
        timecode: of a frame of the film.
        drop: whether timecodes are drop-frame.
    """
    mode = "DROP FRAME" if drop else "NON-DROP FRAME"
    rows = [f"TITLE: {_plain(title)}", f"FCM: {mode}", ""]
    for number, marker in enumerate(markers[:MOST_EVENTS], 1):
        times = [timecode(frame) for frame in (marker.first, marker.stop)]
        note = _plain(marker.note)[:LONGEST_NOTE]
        rows += [
            f"{number:03d}  001      V     C        {' '.join(times)} {' '.join(times)}",
            f"* LOC: {times[0]} {marker.colour.upper():<7} {note}",
            f" |C:ResolveColor{marker.colour.title()} |M:{note.replace('|', '/')}"
            f" |D:{marker.stop - marker.first}",
            "",
        ]
    if len(markers) > MOST_EVENTS:
        rows.append(f"* {len(markers) - MOST_EVENTS} MORE LINES, WHICH ONE LIST CANNOT HOLD")
    return "\n".join(rows) + "\n"


def _plain(text: str) -> str:
    """Text in one row: further rows would be read as events."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
