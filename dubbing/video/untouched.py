"""The proof that a scene left the film alone where there is no new speech."""

import hashlib
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from typing_extensions import TypedDict

from dubbing import media


class Untouched(TypedDict):
    """Comparison of the film's own frames in the film and in the finished file.

    Attributes:
        frames: how many; of: of so many.
        source, result: SHA-256 of their pixels, in order: all values in the film's own format.
        identical: whether these are equal, which only a lossless codec can give.
        psnr: of the worst frame, dB; None where all are equal.
    """

    frames: int
    of: int
    source: str
    result: str
    identical: bool
    psnr: float | None


def compare(film: Path, result: Path, own: np.ndarray, rate: Fraction) -> Untouched:
    """Decode both and compare the frames ``own`` (F,) bool, which are the film's.

    Raises:
        MediaError: one of them cannot be read.
    """
    digests, pixels = (hashlib.sha256(), hashlib.sha256()), media.probe(film).pixels
    worst, most = 0.0, (1 << pixels.bits) - 1
    # A card may follow.
    finished = media.read_planes(result, count=len(own), rate=rate, pixels=pixels)
    pictures = zip(own, media.read_planes(film, rate=rate), finished, strict=True)
    for theirs, source, made in pictures:
        if theirs:
            squared, values = 0.0, 0
            for before, after in zip(source, made, strict=True):
                rows, columns = before.shape  # an encoder may have made them even
                kept = np.ascontiguousarray(after[:rows, :columns])
                for digest, plane in zip(digests, (before, kept), strict=True):
                    digest.update(np.ascontiguousarray(plane).data)
                squared += cv2.norm(before, kept, cv2.NORM_L2SQR)
                values += before.size
            worst = max(worst, squared / values)
    source_digest, result_digest = (digest.hexdigest() for digest in digests)
    return Untouched(
        frames=int(own.sum()),
        of=len(own),
        source=source_digest,
        result=result_digest,
        identical=source_digest == result_digest,
        psnr=round(float(10 * np.log10(most**2 / worst)), 1) if worst else None,
    )
