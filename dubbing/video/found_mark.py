"""Whether the invisible mark of a dub is found in its finished file."""

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from dubbing import media
from dubbing.engine.disk import json_records
from dubbing.errors import ExplainedError
from dubbing.provenance.mark_key import Marking, bits_of
from dubbing.provenance.mark_search import search
from dubbing.provenance.mark_sums import APART
from dubbing.video.files import PICTURE_FILE

MARKED_SECONDS = 20  # of the finished file that are searched for its mark, at most


def found_before(
    last: Path | None, taken: np.ndarray, first: int, rate: Fraction
) -> dict[str, Any] | None:
    """The last answer of `found_again`, if it looked at segments that were taken alone.

    Args:
        last: see `make`. taken: frames (F,) bool of segments that were taken.
        first: frame at which it would begin.
    """
    if last is None or not taken.any():
        return None
    with suppress(ExplainedError):
        before = json_records.read(last / PICTURE_FILE, dict[str, Any], "record").get("mark") or {}
        if before.get("found") and before.get("first") == first:
            stop = first + before["frames"] + 1 + round(APART * rate)  # of frames after them
            if stop <= len(taken) and taken[first:stop].all():
                return before
    return None


def found_again(
    path: Path, marking: Marking, first: int, stop: int, rate: Fraction
) -> dict[str, Any]:
    """Whether the mark is found in frames first .. stop of the finished file, or in the first."""
    stop = min(stop, first + round(MARKED_SECONDS * rate))
    frames = media.read_frames(path, start=first, count=stop - first, pixels="gray")
    wanted = bits_of(marking.id)
    (seen,) = search(frames if stop > first else (), rate, [marking.key()], wanted)
    return {
        "first": first,
        "found": seen.present and np.array_equal(seen.bits, wanted),
        "statistic": round(seen.statistic, 1),
        "threshold": round(seen.threshold, 1),
        "frames": seen.frames,
    }
