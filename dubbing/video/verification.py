"""The last check of a finished video: what is new in it is decoded."""

from fractions import Fraction
from pathlib import Path

import numpy as np

from dubbing import media
from dubbing.errors import RenderingError
from dubbing.video.spans import spans

TOLERANCE = 1e-3  # seconds; Matroska counts whole milliseconds


def as_before(result: Path, last: Path, taken: np.ndarray) -> np.ndarray:
    """Frames (F,) bool of a result that are coded as in the last one, which was verified.

    Args:
        taken: frames (F,) bool that were taken from it, each run from a key frame up to the next.

    Raises:
        MediaError: one of them cannot be read.
    """
    same = np.zeros_like(taken)
    if taken.any() and last.exists():
        pictures = zip(media.coded_pictures(result), media.coded_pictures(last), strict=False)
        coded = [made == before for made, before in pictures][: len(taken)]
        same[: len(coded)] = coded
    return same & taken


def verify(path: Path, frames: int, rate: Fraction, seen: np.ndarray | None = None) -> None:
    """Decode a finished video: its frames, its rate, and that sound and picture begin together.

    Args:
        seen: frames (F,) bool that need not be decoded.

    Raises:
        MediaError: it cannot be decoded.
        RenderingError: something differs.
    """
    info = media.probe(path)
    if seen is None or not seen.any():
        found = media.count_frames(path)
    else:
        found = len(media.coded_pictures(path))
        for first, stop in spans(~seen) if found == frames else ():
            found -= stop - first - media.count_frames(path, first, stop)
    if found != frames:
        raise RenderingError(f"the file holds {found} frames instead of {frames}", path.name)
    if info.rate != rate:
        raise RenderingError(f"the file runs at {info.rate} instead of {rate}", path.name)
    if abs(info.video_start - info.audio_start) > TOLERANCE:
        late = 1000 * (info.audio_start - info.video_start)
        raise RenderingError(f"the sound begins {late:.1f} ms after the picture", path.name)
