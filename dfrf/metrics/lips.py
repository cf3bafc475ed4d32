"""How alike two mouths move: figures of the lips over the frames of a clip.

T frames in a row, L lip points. A series is (T,) float, NaN in a frame that was not measured, so
that frames which are neighbours here are neighbours on film. `found` is what was rendered, `truth`
what the source does. A figure that cannot be computed is NaN.
"""

from __future__ import annotations

import numpy as np

CLOSED = 0.02  # eye distances: inner lips that are nearer are closed
REACH = 0.4  # seconds, to either side, in which a lag is looked for
FEWEST = 3  # frames that a correlation needs


def correlation(found: np.ndarray, truth: np.ndarray) -> float:
    """Pearson's correlation of two series (T,) over the frames that both have.

    NaN where there are fewer than three of them, or one of the series stands still.
    """
    both = np.isfinite(found) & np.isfinite(truth)
    if both.sum() < FEWEST:
        return float("nan")
    a, b = (x[both].astype(np.float64) - x[both].mean(dtype=np.float64) for x in (found, truth))
    scale = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / scale) if scale > 1e-12 else float("nan")


def closure_f1(found: np.ndarray, truth: np.ndarray, near: int = 0) -> float:
    """F1 of the frames in which the lips are closed, 0..1; NaN where neither mouth ever closes.

    Precision is the share of the closed frames found that are closed in truth, recall the share of
    those closed in truth that are found. With ``near`` a frame is right if the other series is
    closed at most so many frames before or after it.

    Args:
        found, truth: (T,) gap between the inner lips, eye distances.
        near: frames.
    """
    both = np.isfinite(found) & np.isfinite(truth)
    shut, real = both & (found < CLOSED), both & (truth < CLOSED)
    if not shut.any() and not real.any():
        return float("nan")
    if not shut.any() or not real.any():
        return 0.0
    precision = float((shut & _widened(real, near)).sum() / shut.sum())
    recall = float((real & _widened(shut, near)).sum() / real.sum())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def _widened(marks: np.ndarray, near: int) -> np.ndarray:
    """Marks (T,) bool, and the frames that are at most ``near`` from one."""
    return np.convolve(marks, np.ones(2 * near + 1), "same")[: len(marks)] > 0.5


def spread_ratio(found: np.ndarray, truth: np.ndarray) -> float:
    """Standard deviation of one series (T,) to that of the other, over the frames both have.

    Of the opening, below 1 is a mumble. NaN where the truth stands still.
    """
    both = np.isfinite(found) & np.isfinite(truth)
    if both.sum() < 2:
        return float("nan")
    spread = float(truth[both].std(dtype=np.float64))
    return float(found[both].std(dtype=np.float64)) / spread if spread > 1e-12 else float("nan")


def energy_ratio(found: np.ndarray, truth: np.ndarray) -> float:
    """Mean of one series (T,) to that of the other, over the frames both have.

    Of gradient energies this is the share of the source's texture: the frames are added up before
    they are divided, so that a smooth mouth of the source cannot make one frame count for many.
    """
    both = np.isfinite(found) & np.isfinite(truth)
    total = float(truth[both].sum(dtype=np.float64))
    return float(found[both].sum(dtype=np.float64)) / total if total > 0 else float("nan")


def distances(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """LMD of each frame (T,): mean distance of lip points (T, L, 2), in their unit."""
    return np.linalg.norm(found - truth, axis=-1).mean(-1)


def squared_distances(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Mean squared distance of the lip points (T, L, 2) of each frame, (T,)."""
    return ((found - truth) ** 2).sum(-1).mean(-1)


def rms(squares: np.ndarray) -> float:
    """Root of the mean of squares (T,), over the frames that have one."""
    known = squares[np.isfinite(squares)]
    return float(np.sqrt(known.mean(dtype=np.float64))) if known.size else float("nan")


def lag_ms(found: np.ndarray, truth: np.ndarray, rate: float, reach: float = REACH) -> float:
    """By how many milliseconds a series (T,) comes after the truth; negative: before it.

    The correlation is taken at every shift of whole frames, and a parabola laid through the highest
    and its neighbours. NaN where that lies at an end of the search, or where nothing correlates
    positively: then there is no lag to speak of.

    Args:
        rate: frames a second.
        reach: seconds of the search, to either side; half the series at most.
    """
    most = max(1, min(round(reach * rate), len(truth) // 2))
    shifts = np.arange(-most, most + 1)
    curve = np.array([correlation(*_shifted(found, truth, int(d))) for d in shifts])
    if not np.isfinite(curve).any():
        return float("nan")
    best = int(np.nanargmax(curve))
    if best in (0, len(curve) - 1) or not np.isfinite(curve[best - 1 : best + 2]).all():
        return float("nan")
    before, peak, after = curve[best - 1 : best + 2]
    if peak <= 0:
        return float("nan")
    bend = before - 2 * peak + after
    part = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(1000 * (shifts[best] + part) / rate)


def _shifted(found: np.ndarray, truth: np.ndarray, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """found[t + shift] beside truth[t], for every t that has both."""
    if shift >= 0:
        return found[shift:], truth[: len(truth) - shift]
    return found[:shift], truth[-shift:]
