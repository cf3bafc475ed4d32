"""Closeness: how near the mouth of a dub comes to the person's own in the film, one number.

A weighted geometric mean of parts, each 0..1, so that one part at 0 cannot be made up for. A part
is 1 - |dub - film| / the larger of the two; where more than the film has is no fault, dub / film
and at most 1.

`python -m dubbing.workshop.training.sync.calibration` fits `WEIGHTS` (docs/development/sync.md).
"""

from dataclasses import dataclass

import numpy as np

from dubbing.sync.result import Figures

# Timing halves where ITU-R BT.1359 finds that viewers notice, ms of sound that is early and late.
NOTICED_EARLY_MS, NOTICED_LATE_MS = 45.0, 125.0
WEIGHTS = {
    "timing": 0.34,
    "certainty": 0.025,
    "opening": 0.025,
    "closures": 0.05,
    "range": 0.055,
    "speed": 0.12,
    "loudness": 0.025,
    "sharpness": 0.23,
    "silence": 0.13,
}
LEAST = 0.05  # of a part, for its logarithm
# A film's own figures count as at least these: a mouth that hides its words must not excuse all.
LEAST_CERTAINTY = 0.09
LEAST_CORRELATION = 0.2


@dataclass(frozen=True)
class Closeness:
    """The number, and the parts that it is made of."""

    number: float
    parts: dict[str, float]

    @property
    def weakest(self) -> str:
        """The part that lowers the number most."""
        return min(self.parts, key=lambda part: WEIGHTS[part] * _log(self.parts[part]))

    @property
    def follows(self) -> float:
        """How well the mouth follows the words, by both networks that heard them."""
        return self.parts["certainty"] * self.parts["opening"]


def closeness(dub: Figures, film: Figures, early_ms: float) -> Closeness:
    """Closeness of a dub to its film.

    Args:
        early_ms: by which the dub's sound is early.
    """
    noticed = NOTICED_EARLY_MS if early_ms > 0 else NOTICED_LATE_MS
    parts = {
        "timing": 2 ** (-abs(early_ms) / noticed),
        "certainty": _most(dub.certainty, max(film.certainty, LEAST_CERTAINTY)),
        "opening": _most(dub.opening, max(film.opening, LEAST_CORRELATION)),
        "closures": _most(dub.closures, max(film.closures, LEAST_CORRELATION)),
        "range": _near(dub.range, film.range),
        "speed": _near(dub.speed, film.speed),
        "loudness": max(0.0, 1 - abs(dub.loudness - film.loudness)),
        "sharpness": _near(dub.sharpness, film.sharpness),
    }
    if dub.restless is not None:
        parts["silence"] = 1 - max(0.0, dub.restless - (film.restless or 0.0))
    return Closeness(number_of(parts), parts)


def number_of(parts: dict[str, float]) -> float:
    """The weighted geometric mean of the parts that could be measured."""
    total = sum(WEIGHTS[name] for name in parts)
    return float(2 ** (sum(WEIGHTS[name] * _log(part) for name, part in parts.items()) / total))


def _near(dub: float, film: float) -> float:
    return min(dub, film) / max(dub, film, 1e-6)


def _most(dub: float, film: float) -> float:
    return min(1.0, max(0.0, dub / film))


def _log(part: float) -> float:
    return float(np.log2(max(part, LEAST)))
