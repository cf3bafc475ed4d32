"""Lip metrics: the motion of a rendered mouth compared with that of the source clip.

T frames in a row, L lip points. A series is (T,) float, NaN in a frame that was not measured, so
neighbours in a series are neighbours in the video. `rendered` is measured on the rendering, `truth`
on the source. A figure that cannot be computed is NaN.
"""

from __future__ import annotations

import numpy as np

CLOSED = 0.02  # eye distances: a mouth with a smaller gap is closed
MAX_LAG_S = 0.4  # to either side
MIN_FRAMES = 3  # frames that a correlation needs


def correlation(rendered: np.ndarray, truth: np.ndarray) -> float:
    """Pearson's correlation of two series (T,) over the frames that both have.

    NaN where there are fewer than three of them, or one of the series stands still.
    """
    both = np.isfinite(rendered) & np.isfinite(truth)
    if both.sum() < MIN_FRAMES:
        return float("nan")
    a, b = (x[both].astype(np.float64) - x[both].mean(dtype=np.float64) for x in (rendered, truth))
    scale = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / scale) if scale > 1e-12 else float("nan")


def closure_f1(rendered: np.ndarray, truth: np.ndarray, tolerance: int = 0) -> float:
    """F1 of the frames in which the lips are closed, 0..1; NaN where neither mouth ever closes.

    Precision is the share of the rendered closures that are closed in truth, recall the share of
    the true closures that are rendered.

    Args:
        rendered, truth: (T,) gap between the inner lips, eye distances.
        tolerance: frames; a closure counts if the other mouth closes at most so many frames before
            or after it.
    """
    both = np.isfinite(rendered) & np.isfinite(truth)
    shut, real = both & (rendered < CLOSED), both & (truth < CLOSED)
    if not shut.any() and not real.any():
        return float("nan")
    if not shut.any() or not real.any():
        return 0.0
    precision = float((shut & _widened(real, tolerance)).sum() / shut.sum())
    recall = float((real & _widened(shut, tolerance)).sum() / real.sum())
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def closure_mcc(rendered: np.ndarray, truth: np.ndarray) -> float:
    """Matthews correlation of the frames in which the lips are closed, -1..1.

    A mouth that never opens has 0, unlike its F1. NaN where the true mouth never closes or never
    opens.

    Args:
        rendered, truth: (T,) gap between the inner lips, eye distances.
    """
    both = np.isfinite(rendered) & np.isfinite(truth)
    shut, real = rendered[both] < CLOSED, truth[both] < CLOSED
    if not real.any() or real.all():
        return float("nan")
    return float(np.corrcoef(shut, real)[0, 1]) if 0 < shut.mean() < 1 else 0.0


def _widened(marks: np.ndarray, tolerance: int) -> np.ndarray:
    """Marks (T,) bool, extended by ``tolerance`` frames to each side."""
    return np.convolve(marks, np.ones(2 * tolerance + 1), "same")[: len(marks)] > 0.5


def spread_ratio(rendered: np.ndarray, truth: np.ndarray) -> float:
    """Ratio of the standard deviations of two series (T,), over the frames both have.

    For the opening, less than 1 is a mumble. NaN where the truth stands still.
    """
    both = np.isfinite(rendered) & np.isfinite(truth)
    if both.sum() < 2:
        return float("nan")
    spread = float(truth[both].std(dtype=np.float64))
    return float(rendered[both].std(dtype=np.float64)) / spread if spread > 1e-12 else float("nan")


def energy_ratio(rendered: np.ndarray, truth: np.ndarray) -> float:
    """Ratio of the means of two series (T,), over the frames both have.

    For gradient energies this is the share of the source's texture. Sums are divided, not frames,
    so that a smooth mouth of the source cannot make one frame count for many.
    """
    both = np.isfinite(rendered) & np.isfinite(truth)
    total = float(truth[both].sum(dtype=np.float64))
    return float(rendered[both].sum(dtype=np.float64)) / total if total > 0 else float("nan")


def distances(rendered: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """LMD of each frame (T,): mean distance of lip points (T, L, 2), in their unit."""
    return np.linalg.norm(rendered - truth, axis=-1).mean(-1)


def squared_distances(rendered: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Mean squared distance of the lip points (T, L, 2) of each frame, (T,)."""
    return ((rendered - truth) ** 2).sum(-1).mean(-1)


def rms(squares: np.ndarray) -> float:
    """Root of the mean of squares (T,), over the frames that have one."""
    known = squares[np.isfinite(squares)]
    return float(np.sqrt(known.mean(dtype=np.float64))) if known.size else float("nan")


def lag_ms(
    rendered: np.ndarray, truth: np.ndarray, rate: float, max_lag: float = MAX_LAG_S
) -> float:
    """Lag of a series (T,) behind the truth, milliseconds; negative where it is ahead.

    The correlation is computed at every shift of whole frames, and a parabola is fitted to the
    highest and its neighbours. NaN where the peak lies at an end of the search, or where no
    correlation is positive.

    Args:
        rate: frames a second.
        max_lag: seconds to either side that are searched; half the series at most.
    """
    most = max(1, min(round(max_lag * rate), len(truth) // 2))
    shifts = np.arange(-most, most + 1)
    curve = np.array([correlation(*_shifted(rendered, truth, int(d))) for d in shifts])
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


def _shifted(rendered: np.ndarray, truth: np.ndarray, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """rendered[t + shift] beside truth[t], for every t that has both."""
    if shift >= 0:
        return rendered[shift:], truth[: len(truth) - shift]
    return rendered[:shift], truth[-shift:]
