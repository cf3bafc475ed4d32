"""Distances over offsets, and the estimates from them.

Letters: F frames, E embedding size, K = 31 offsets.

An offset is counted as SyncNet counts: positive when the audio is early, so that the picture of
frame i belongs to the sound of frame i - offset.
"""

from dataclasses import dataclass

import numpy as np

REACH = 15
OFFSETS = tuple(range(-REACH, REACH + 1))


@dataclass(frozen=True)
class Estimate:
    """Offset (frames), confidence (median minus minimum) and minimum of a curve over OFFSETS."""

    offset: int
    confidence: float
    distance: float


def distances(mouth: np.ndarray, sound: np.ndarray, reach: int = REACH) -> np.ndarray:
    """Distance of every frame's mouth to the sound at every offset -reach..reach, (F, K) float32.

    Args:
        mouth: (F, E), NaN where there is none.
        sound: (F + 2 reach, E): embeddings of the sound at frames -reach .. F + reach - 1, NaN
            beyond the ends.
    """
    count = len(mouth)
    columns = []
    for offset in range(-reach, reach + 1):
        shifted = sound[reach - offset : reach - offset + count]
        columns.append(np.linalg.norm(mouth - shifted, axis=1))
    return np.stack(columns, axis=1).astype(np.float32)


@dataclass
class CurveSum:
    """Weighted mean of distance rows that comes together piece by piece."""

    total: np.ndarray
    weight: np.ndarray
    rows: int = 0

    @classmethod
    def empty(cls) -> "CurveSum":
        return cls(np.zeros(len(OFFSETS)), np.zeros(len(OFFSETS)))

    def add(self, rows: np.ndarray, weights: np.ndarray) -> None:
        """Rows (F, K), NaN where there is no pair; weights (F,)."""
        there = np.isfinite(rows)
        self.total += (np.where(there, rows, 0) * weights[:, None]).sum(0)
        self.weight += (there * weights[:, None]).sum(0)
        self.rows += int(there.any(1).sum())

    def curve(self) -> np.ndarray:
        """Mean distance at each offset (K,); NaN where nothing was compared."""
        return np.where(self.weight > 0, self.total / np.maximum(self.weight, 1e-12), np.nan)


def estimate(curve: np.ndarray) -> Estimate | None:
    """Offset and confidence of a curve (K,); None if it has a gap (too little was seen)."""
    if not np.isfinite(curve).all():
        return None
    best = int(np.argmin(curve))
    distance = float(curve[best])
    return Estimate(OFFSETS[best], float(np.median(curve)) - distance, distance)
