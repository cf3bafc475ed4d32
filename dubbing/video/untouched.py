"""The proof that a scene left the film alone where there is no new speech."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from typing_extensions import TypedDict

from dubbing import media
from dubbing.video.spans import spans


class Part(TypedDict):
    """The film's own frames in one segment of a result.

    Attributes:
        frames: how many.
        source, result: SHA-256 of their pixels, in order: all values in the film's own format.
        worst: largest mean squared error of a frame.
    """

    frames: int
    source: str
    result: str
    worst: float


class Untouched(TypedDict):
    """Comparison of the film's own frames in the film and in the finished file.

    Attributes:
        frames: how many; of: of so many.
        source, result: SHA-256 of those of the parts, in order.
        identical: whether these are equal, which only a lossless codec can give.
        psnr: of the worst frame, dB; None where all are equal.
    """

    frames: int
    of: int
    source: str
    result: str
    identical: bool
    psnr: float | None


class Proof(TypedDict):
    """Of all frames, and of each segment that holds some of the film's, by its first frame."""

    untouched: Untouched | None
    parts: dict[str, Part]


@dataclass
class _Sums:
    """Differences and digests of a part, summed frame by frame."""

    frames: int = 0
    worst: float = 0.0
    digests: tuple[Any, Any] = field(default_factory=lambda: (hashlib.sha256(), hashlib.sha256()))

    def add(self, source: media.Planes, made: media.Planes) -> None:
        squared, values = 0.0, 0
        for before, after in zip(source, made, strict=True):
            rows, columns = before.shape  # an encoder may have made them even
            kept = np.ascontiguousarray(after[:rows, :columns])
            for digest, plane in zip(self.digests, (before, kept), strict=True):
                digest.update(np.ascontiguousarray(plane).data)
            squared += cv2.norm(before, kept, cv2.NORM_L2SQR)
            values += before.size
        self.frames += 1
        self.worst = max(self.worst, squared / values)

    def part(self) -> Part:
        source, result = (digest.hexdigest() for digest in self.digests)
        return Part(frames=self.frames, source=source, result=result, worst=self.worst)


def prove(
    film: Path,
    result: Path,
    own: np.ndarray,
    rate: Fraction,
    segment: int,
    before: Proof | None,
    same: np.ndarray,
) -> Proof:
    """Compare the frames ``own`` (F,) bool of a result, which are the film's, with the film.

    Of both, just these are decoded.

    Args:
        segment: frames of each segment.
        before: of the last result. same: frames (F,) bool that are coded as there: where all of a
            segment are, what was proven of it holds.

    Raises:
        MediaError: one of them cannot be read.
    """
    parts: dict[str, Part] = {}
    left = own.copy()
    for first in range(0, len(own), segment):
        here = np.s_[first : first + segment]
        known = before["parts"].get(str(first)) if before is not None else None
        if known is not None and same[here].all() and known["frames"] == own[here].sum():
            parts[str(first)] = known
            left[here] = False
    parts |= _compared(film, result, left, rate, segment)
    return Proof(untouched=_together(film, parts, len(own)) if parts else None, parts=parts)


def _compared(
    film: Path, result: Path, own: np.ndarray, rate: Fraction, segment: int
) -> dict[str, Part]:
    """Both decoded where frames ``own`` are the film's: what each segment holds of them."""
    sums: dict[str, _Sums] = {}
    pixels = media.probe(film).pixels
    for first, stop in spans(own):
        count = stop - first
        pictures = zip(
            media.read_planes(film, start=first, count=count, rate=rate),
            media.read_planes(result, start=first, count=count, rate=rate, pixels=pixels),
            strict=True,
        )
        for k, (source, made) in enumerate(pictures, first):
            sums.setdefault(str(k - k % segment), _Sums()).add(source, made)
    return {number: one.part() for number, one in sums.items()}


def _together(film: Path, parts: Mapping[str, Part], frames: int) -> Untouched:
    """All parts of a result of so many frames."""
    ordered = [parts[first] for first in sorted(parts, key=int)]
    source, result = (
        hashlib.sha256("".join(digests).encode()).hexdigest()
        for digests in zip(*((part["source"], part["result"]) for part in ordered), strict=True)
    )
    worst = max(part["worst"] for part in ordered)
    most = (1 << media.probe(film).pixels.bits) - 1
    return Untouched(
        frames=sum(part["frames"] for part in ordered),
        of=frames,
        source=source,
        result=result,
        identical=source == result,
        psnr=round(float(10 * np.log10(most**2 / worst)), 1) if worst else None,
    )
