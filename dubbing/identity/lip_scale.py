"""Size of a person's lip measures: mean and spread of the lengths that they were computed from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from dubbing.face.lip_measures import lip_lengths
from dubbing.identity.learned import Seconds
from dubbing.preparation.prepared import PreparedClip


@dataclass(frozen=True)
class LipScale:
    """From lip measures, of mean 0 and variance 1 in what was learned, to eye distances.

    Attributes:
        mean, spread: (L,) of the lengths.
    """

    mean: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(cls, clips: Sequence[tuple[PreparedClip, Seconds]]) -> Self:
        """That of clips, and the seconds of each that were learned from."""
        lengths = []
        for clip, seconds in clips:
            learned = np.zeros(len(clip), bool)
            for start, stop in seconds:
                learned[round(start * clip.rate) : round(stop * clip.rate)] = True
            lengths.append(lip_lengths(clip.frontal_landmarks()[learned & clip.detected]))
        every = np.concatenate(lengths)
        return cls(every.mean(0), every.std(0))

    def lengths(self, measures: np.ndarray) -> np.ndarray:
        """Lengths (F, L) in eye distances; a gap is never below 0."""
        return np.asarray(np.maximum(measures * self.spread + self.mean, 0))

    def measures(self, lengths: np.ndarray) -> np.ndarray:
        """Lip measures (F, L) of lengths in eye distances."""
        return np.asarray((lengths - self.mean) / np.maximum(self.spread, 1e-6))
