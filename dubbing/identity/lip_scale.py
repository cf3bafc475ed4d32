"""Size of a person's lip measures: mean and spread of the lengths that they were computed from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np

from dubbing.face.mouth.lip_curves import LipCurves
from dubbing.face.mouth.lip_measures import lip_lengths, lips_touch, standardised
from dubbing.identity.learned import learned
from dubbing.preparation.prepared import PreparedClip
from dubbing.script.edit import Edit

CLOSED_SHARE = 0.05  # of the frames, as in `dfrf.field.speaker_adaptation`
PARTING = 0.75  # of the touching frames are closed more than lips that part; by development people
MOST_TOUCHING = 0.8  # of the way from a closed mouth to one that hardly opens
BEGUN = 0.1  # strength from which on lips have parted: 0 is a closed mouth


@dataclass(frozen=True)
class LipScale:
    """From lip measures, of mean 0 and variance 1 in what was learned, to eye distances.

    Attributes:
        mean, spread: (L,) of the lengths.
        parting: measure of the opening at which the lips part, as a share of a closed mouth's.
    """

    mean: np.ndarray
    spread: np.ndarray
    parting: float = 1.0

    @classmethod
    def of(cls, model: Path, clips: Sequence[PreparedClip]) -> Self:
        """That of a model in a folder, which was learned from clips."""
        lengths, touching = [], []
        for clip, (_, some, turned) in zip(clips, learned(model), strict=True):
            own = np.zeros(len(clip), bool)
            for start, stop in (*some, *turned):
                own[round(start * clip.rate) : round(stop * clip.rate)] = True
            own &= clip.detected
            spoken = clip.spoken()
            lengths.append(lip_lengths(spoken.frontal_landmarks()[own]))
            touching.append(lips_touch(spoken.landmarks[own], clip.eye_distances()[own]))
        every = np.concatenate(lengths)
        return cls(every.mean(0), every.std(0), _parting(every[:, 0], np.concatenate(touching)))

    def lengths(self, measures: np.ndarray) -> np.ndarray:
        """Lengths (F, L) in eye distances; a gap is never below 0."""
        return np.asarray(np.maximum(measures * self.spread + self.mean, 0))

    def measures(self, lengths: np.ndarray) -> np.ndarray:
        """Lip measures (F, L) of lengths in eye distances."""
        return np.asarray((lengths - self.mean) / np.maximum(self.spread, 1e-6))

    def shares(self, strength: np.ndarray, spoken: np.ndarray, closed: float) -> np.ndarray:
        """Shares (F,) of the way from the closed mouth at which openings are `strength` as wide.

        A closed mouth is pressed: over the first part of the way the lips still touch.

        Args:
            strength: (F,) of what is seen beyond a closed mouth; 0 and 1 stay, and what is more.
            spoken, closed: measures of the opening, (F,) as spoken and of the closed mouth.
        """
        way = spoken - closed
        touching = np.clip((self.parting - 1) * closed / np.maximum(way, 1e-6), 0, MOST_TOUCHING)
        begun = np.clip(strength / BEGUN, 0, 1)
        found = touching * begun + (1 - touching) * strength
        return np.where((strength < 1) & (way > 0), found, strength).astype(np.float32)


def _parting(opening: np.ndarray, touching: np.ndarray) -> float:
    """See `LipScale`; of the openings (T,) of frames, in some of which the lips touch."""
    measures = standardised(opening[:, None])[:, 0]
    closed = np.sort(measures)[: max(1, round(CLOSED_SHARE * len(measures)))].mean()
    parted = np.quantile(measures, PARTING * touching.mean())
    return float(np.clip(parted / closed, 0, 1)) if closed < 0 else 1.0


Scale = Callable[[], LipScale]  # read where it is needed


def given_lips(edit: Edit, frames: int, rate: Fraction, scale: Scale) -> np.ndarray | None:
    """Lip measures and closures (F, L + 1) that the curves of an edit give in the frames of its
    line; else NaN.
    """
    if edit.curves is None:
        return None
    values = LipCurves.read(*edit.curves).at(edit.heard(frames, rate))
    return np.c_[scale().measures(values[:, :-1]), values[:, -1:]].astype(np.float32)
