"""The timecode of a video, and the number of timecodes a second, which its text does not show.

PyAV gives only the text. A video of 59.94 frames a second may have a timecode track of 30.
"""

import re
from fractions import Fraction
from pathlib import Path

import av

from dubbing.script.timecode import frame_of, nominal

MAX_BYTES = 1 << 26  # of a header that are read
# QuickTime: the sample description of a timecode track ends with its timecodes a second.
MOV = re.compile(rb"stsd\0{4}\0{3}\x01.{4}tmcd.{24}(?P<count>.)", re.DOTALL)
# MXF: the rounded timecode base, local tag 15.02, of two bytes.
MXF = re.compile(rb"\x15\x02\x00\x02\x00(?P<count>.)", re.DOTALL)


def timecode_of(
    path: Path, container: av.container.InputContainer, rate: Fraction
) -> tuple[str, int | None]:
    """The timecode of a track or of the file, if it fits the rate, and its timecodes a second."""
    places = [stream.metadata for stream in container.streams] + [container.metadata]
    tags = [item for place in places for item in place.items()]
    written = next((value for key, value in tags if key.lower() == "timecode"), "")
    if not written:
        return "", None
    each = nominal(rate)
    count = count_of(path, container.format.name) or each
    try:
        if max(count, each) % min(count, each):
            return "", None
        frame_of(written, rate * Fraction(count, each))
    except ValueError:
        return "", None
    return written, None if count == each else count


def count_of(path: Path, container: str) -> int | None:
    """Timecodes a second in a file of a container, ffmpeg's name; None if unknown."""
    if "mov" in container.split(","):
        match = MOV.search(_movie_box(path))
    elif container == "mxf":
        with path.open("rb") as file:
            match = MXF.search(file.read(1 << 20))
    else:
        match = None
    return (match["count"][0] or None) if match else None


def _movie_box(path: Path) -> bytes:
    """The box ``moov`` of a QuickTime or MP4 file, which may lie at its end; empty without one."""
    with path.open("rb") as file:
        while len(head := file.read(8)) == 8:
            size, at = int.from_bytes(head[:4], "big"), 8
            if size == 1:
                size, at = int.from_bytes(file.read(8), "big"), 16
            if head[4:] == b"moov":
                return file.read(min(size - at if size else MAX_BYTES, MAX_BYTES))
            if size < at:
                break
            file.seek(size - at, 1)
    return b""
