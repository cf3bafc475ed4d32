"""Curves of distance over offset, and the estimates from them.

Letters: F frames, E embedding size, K = 31 offsets.

The sign of an offset is SyncNet's: positive when the audio is early, so that the image of frame i
belongs to the sound of frame i - offset.
"""

from dataclasses import dataclass

import numpy as np

MAX_OFFSET = 15  # frames
OFFSETS = tuple(range(-MAX_OFFSET, MAX_OFFSET + 1))


@dataclass(frozen=True)
class Estimate:
    """Offset (frames), confidence (median minus minimum) and minimum of a curve over OFFSETS."""

    offset: int
    confidence: float
    distance: float


def distances(mouth: np.ndarray, sound: np.ndarray, max_offset: int = MAX_OFFSET) -> np.ndarray:
    """Distance of every frame's mouth to the sound at every offset, (F, K) float32.

    Args:
        mouth: (F, E), NaN without a mouth.
        sound: (F + 2 max_offset, E): embeddings of the sound, from `max_offset` frames before the
            first mouth to as many after the last; NaN beyond the ends.
        max_offset: frames; K = 2 max_offset + 1 offsets from -max_offset on.
    """
    count = len(mouth)
    columns = []
    for offset in range(-max_offset, max_offset + 1):
        shifted = sound[max_offset - offset : max_offset - offset + count]
        columns.append(np.linalg.norm(mouth - shifted, axis=1))
    return np.stack(columns, axis=1).astype(np.float32)


@dataclass
class CurveSum:
    """Weighted mean of distance rows, summed block by block."""

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
    """Offset and confidence of a curve (K,); None if it has gaps, for lack of frames."""
    if not np.isfinite(curve).all():
        return None
    best = int(np.argmin(curve))
    distance = float(curve[best])
    return Estimate(OFFSETS[best], float(np.median(curve)) - distance, distance)


def early_ms(curve: np.ndarray, rate: float) -> float:
    """Where a curve (K,) is lowest, between frames, in ms by which the audio is early."""
    best = int(np.argmin(curve))
    if 0 < best < len(curve) - 1:
        before, lowest, after = curve[best - 1 : best + 2]
        between = (before - after) / max(before - 2 * lowest + after, 1e-9) / 2
    else:
        between = 0.0
    return float((best - len(curve) // 2 + between) * 1000 / rate)
