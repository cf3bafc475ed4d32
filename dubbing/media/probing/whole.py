"""Finds files that break off, as half of a copy does, or begin anew, and frames without times."""

from collections.abc import Sequence
from pathlib import Path

import av

from dubbing.errors import MediaError

COMPLETE = 0.98  # share of the header's number of frames (most containers have none), and seconds
MISSING = 0.5  # seconds that may be missing beside them
BACK = 0.5  # seconds by which times of decoding may fall: they only rise, but for faulty writers
# Containers whose header says how long they are. Of others, ffmpeg guesses.
TIMED = ("matroska,webm", "wav", "aiff", "flac")
STREAMED = 0x7FF00000  # bytes; what is written to a pipe says that it is at least as long
REMEDY = "copy or convert the file again"


def check_whole(
    path: Path,
    container: av.container.InputContainer,
    frames: int,
    pictures: int,
    times: Sequence[float],
    end: float,
) -> None:
    """Compare what a file holds with its header.

    Args:
        frames: of its picture by the header; 0 where it does not say.
        pictures, times: packets with a frame, and the times of the frames in seconds.
        end: of its last packet, in seconds after the first.

    Raises:
        MediaError: it holds less.
    """
    there = _counted(container, pictures, times)
    if there < COMPLETE * frames:
        raise MediaError(f"it breaks off: {there} of {frames} frames are there", str(path), REMEDY)
    seconds = (container.duration or 0) / av.time_base * (container.format.name in TIMED)
    size, written = path.stat().st_size, _riff_size(path)
    if end < COMPLETE * seconds - MISSING:
        what = f"{end:.1f} of {seconds:.1f} s are there"
    elif size < COMPLETE * written:
        what = f"{size} of {written} bytes are there"
    else:
        return
    raise MediaError(f"it breaks off: {what}", str(path), REMEDY)


def check_frames(path: Path, pictures: int, untimed: int, times: Sequence[float]) -> None:
    """Look for frames that cannot be placed in time.

    Args:
        pictures, untimed: packets with a frame, and those of them without a time stamp.
        times: of the frames, in seconds.

    Raises:
        MediaError: there are some, or there are no frames.
    """
    if not times:
        raise MediaError("no frame in its video stream", str(path), "is the file complete?")
    if untimed:
        # As in a Matroska file with negative times: ffmpeg would guess, and drop frames that clash.
        what = f"{untimed} of its {pictures} frames have no time stamp"
        raise MediaError(what, str(path), "convert the file again")
    if len(times) > 1 and min(times) == max(times):
        same = "all its frames have the same time stamp"
        raise MediaError(same, str(path), "convert the file again")


def check_order(path: Path, before: float, time: float) -> None:
    """Compare two times of decoding that follow one another in a track, in seconds.

    Raises:
        MediaError: they begin anew, as where files were joined byte by byte.
    """
    if time < before - BACK:
        what = f"its time stamps begin anew after {before:.1f} s, as of several files in one"
        raise MediaError(what, str(path), "convert the file again, or give its parts")


def _counted(container: av.container.InputContainer, pictures: int, times: Sequence[float]) -> int:
    """Number of frames as the header counts them, from frames with these times.

    The header of an AVI counts ticks of its clock, which may be finer than frames.
    """
    many = len(times)
    if container.format.name != "avi" or many < 2:
        return pictures
    ticks = (max(times) - min(times)) / float(container.streams.video[0].time_base or 1)
    return max(pictures, round(ticks * (many + 1) / (many - 1)))


def _riff_size(path: Path) -> int:
    """Bytes of a WAV file by its header, where that says so; else 0."""
    with path.open("rb") as file:
        head = file.read(12)
    size = int.from_bytes(head[4:8], "little")
    return size + 8 if head[:4] + head[8:] == b"RIFFWAVE" and size < STREAMED else 0
