"""Size of a person's lip measures: mean and spread of the lengths that they were computed from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np

from dubbing.face.lip_curves import LipCurves
from dubbing.face.lip_measures import lip_lengths
from dubbing.identity.learned import learned
from dubbing.preparation.prepared import PreparedClip
from dubbing.script.timeline import Edit


@dataclass(frozen=True)
class LipScale:
    """From lip measures, of mean 0 and variance 1 in what was learned, to eye distances.

    Attributes:
        mean, spread: (L,) of the lengths.
    """

    mean: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(cls, model: Path, clips: Sequence[PreparedClip]) -> Self:
        """That of a model in a folder, which was learned from clips."""
        lengths = []
        for clip, (_, some, turned) in zip(clips, learned(model), strict=True):
            own = np.zeros(len(clip), bool)
            for start, stop in (*some, *turned):
                own[round(start * clip.rate) : round(stop * clip.rate)] = True
            lengths.append(lip_lengths(clip.frontal_landmarks()[own & clip.detected]))
        every = np.concatenate(lengths)
        return cls(every.mean(0), every.std(0))

    def lengths(self, measures: np.ndarray) -> np.ndarray:
        """Lengths (F, L) in eye distances; a gap is never below 0."""
        return np.asarray(np.maximum(measures * self.spread + self.mean, 0))

    def measures(self, lengths: np.ndarray) -> np.ndarray:
        """Lip measures (F, L) of lengths in eye distances."""
        return np.asarray((lengths - self.mean) / np.maximum(self.spread, 1e-6))


def moments(frames: int, rate: Fraction, shift: float = 0.0) -> np.ndarray:
    """Seconds (F,) of a line's sound in the middle of its frames, whose mouth comes later (ms)."""
    return np.asarray((np.arange(frames) + 0.5) / float(rate) - shift / 1000)


def given_lips(
    edit: Edit, frames: int, rate: Fraction, scale: Callable[[], LipScale]
) -> np.ndarray | None:
    """Lip measures (F, L) that the curves of an edit give in the frames of its line; else NaN."""
    if edit.curves is None:
        return None
    lengths = LipCurves.read(*edit.curves).at(moments(frames, rate, edit.shift))
    return scale().measures(lengths).astype(np.float32)
