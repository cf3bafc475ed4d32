"""The proof that a scene left the film alone where there is no new speech."""

import hashlib
from fractions import Fraction
from pathlib import Path

import numpy as np
from typing_extensions import TypedDict

from dubbing import media


class Untouched(TypedDict):
    """Comparison of the film's own frames in the film and in the finished file.

    Attributes:
        frames: how many; of: of so many.
        source, result: SHA-256 of their pixels (RGB, 8 bits), in order.
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
    digests = hashlib.sha256(), hashlib.sha256()
    worst = 0.0
    finished = media.read_frames(result, count=len(own), rate=rate)  # a card may follow
    pictures = zip(media.read_frames(film, rate=rate), finished, strict=True)
    for theirs, (source, made) in zip(own, pictures, strict=True):
        if theirs:
            height, width = source.shape[:2]  # an encoder may have made them even
            result_picture = np.ascontiguousarray(made[:height, :width])
            for digest, picture in zip(digests, (source, result_picture), strict=True):
                digest.update(picture.data)
            difference = source.astype(np.int16) - result_picture
            worst = max(worst, float(np.mean(np.square(difference, dtype=np.float32))))
    source_digest, result_digest = (digest.hexdigest() for digest in digests)
    return Untouched(
        frames=int(own.sum()),
        of=len(own),
        source=source_digest,
        result=result_digest,
        identical=source_digest == result_digest,
        psnr=round(float(10 * np.log10(255**2 / worst)), 1) if worst else None,
    )
