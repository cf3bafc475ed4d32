"""A clip's own offset between picture and sound, found by canonical correlation.

Closed form, so it needs nothing trained: the floor our network stands on. Every clip is judged
by the directions that correlate in all the *other* clips, once they are aligned themselves.

Letters: W moments, X and Y features of mouth and sound, L lags.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from dubbing.sync.network.channels import SOUND_CHANNELS, centred
from dubbing.sync.network.embeddings import mouth_windows, sound_windows
from dubbing.workshop.training.sync.clips import TalkingClip

STEP = 0.04
# Lags that are tried: +-0.6 s in steps of a sound feature.
LAGS = np.arange(-30, 31) * 0.02
COMPONENTS = 12
CEPSTRA = 20
DIRECTIONS = 10
RIDGE = 0.05
ROUNDS = 4
# A clip whose best correlation stays below this has no offset one could trust.
TRUSTED_PEAK = 0.15


@dataclass(frozen=True)
class Correlator:
    """Projections of both sides, (X, d) and (Y, d), and the correlations (d,) they reach."""

    mouth: np.ndarray
    sound: np.ndarray
    strength: np.ndarray


def lip_basis(clips: Sequence[TalkingClip], components: int) -> np.ndarray:
    """Principal directions of the lips' motion (2 M, components), scaled to unit deviation.

    Every person weighs about the same; directions weaker than landmark noise are not blown up.
    """
    parts = []
    for clip in clips:
        flat = centred(clip.shapes, clip.times)
        parts.append(flat[:: max(1, len(flat) // 200)])
    motion = np.concatenate(parts)
    _, sizes, directions = np.linalg.svd(motion, full_matrices=False)
    deviation = np.maximum(sizes[:components] / len(motion) ** 0.5, 0.004)
    return (directions[:components].T / deviation).astype(np.float32)


def _cepstra(mel: np.ndarray) -> np.ndarray:
    bands = mel.shape[-1]
    waves = np.cos(np.pi * np.outer(np.arange(bands) + 0.5, np.arange(CEPSTRA)) / bands)
    return mel @ (waves * 2 / bands).astype(np.float32)


def _moments(clip: TalkingClip) -> np.ndarray:
    return np.arange(clip.times[0] + 0.1, clip.times[-1] - 0.1, STEP)


def _mouth_side(clip: TalkingClip, basis: np.ndarray) -> np.ndarray:
    shapes = centred(clip.shapes, clip.times) @ basis
    x = mouth_windows(shapes, clip.times, _moments(clip)).reshape(len(_moments(clip)), -1)
    return x - x.mean(0)


def _sound_side(clip: TalkingClip, cepstra: np.ndarray, lag: float) -> np.ndarray:
    y = sound_windows(cepstra, _moments(clip) + lag).reshape(len(_moments(clip)), -1)
    return y - y.mean(0)


def _ridged(square: np.ndarray) -> np.ndarray:
    return square + RIDGE * np.trace(square) / len(square) * np.eye(len(square))


def fit(clips: Sequence[TalkingClip], basis: np.ndarray) -> Correlator:
    """Ridge-regularised canonical correlation (Hotelling 1936) of aligned clips."""
    xs, ys = [], []
    for clip in clips:
        x = _mouth_side(clip, basis)
        y = _sound_side(clip, _cepstra(clip.sound[:, SOUND_CHANNELS["mel"]]), clip.offset)
        # Long clips count more, but not in proportion.
        weight = min(1.0, (400 / len(x)) ** 0.5)
        xs.append(x * weight)
        ys.append(y * weight)
    x, y = np.concatenate(xs).astype(np.float64), np.concatenate(ys).astype(np.float64)
    xx, yy, xy = _ridged(x.T @ x), _ridged(y.T @ y), x.T @ y
    lx, ly = linalg.cholesky(xx, lower=True), linalg.cholesky(yy, lower=True)
    inner = linalg.solve_triangular(ly, xy.T, lower=True).T
    u, s, vt = np.linalg.svd(linalg.solve_triangular(lx, inner, lower=True))
    return Correlator(
        linalg.solve_triangular(lx.T, u[:, :DIRECTIONS]),
        linalg.solve_triangular(ly.T, vt[:DIRECTIONS].T),
        s[:DIRECTIONS],
    )


def correlation_curve(clip: TalkingClip, basis: np.ndarray, correlator: Correlator) -> np.ndarray:
    """Correlation of mouth and sound at every lag of LAGS, (L,)."""
    curve = []
    cepstra = _cepstra(clip.sound[:, SOUND_CHANNELS["mel"]])
    a = _mouth_side(clip, basis) @ correlator.mouth
    for lag in LAGS:
        b = _sound_side(clip, cepstra, float(lag)) @ correlator.sound
        power = np.sqrt((a * a @ correlator.strength).sum() * (b * b @ correlator.strength).sum())
        curve.append((a * b @ correlator.strength).sum() / max(power, 1e-12))
    return np.array(curve)


def align(clips: Sequence[TalkingClip]) -> tuple[list[TalkingClip], list[float]]:
    """The clips with their own offsets, and how sure each one is (its correlation).

    Starts from no offsets; every round moves each clip to where the others' directions correlate
    best. An offset common to all clips cannot be found this way: it is set so that the median of
    the exact clips is 0, and stays where there are none.

    Raises:
        ValueError: fewer than three clips.
    """
    if len(clips) < 3:
        raise ValueError("own offsets are found by comparison: at least three clips are needed")
    aligned = list(clips)
    peaks = [1.0] * len(clips)
    basis = lip_basis(clips, COMPONENTS)
    for _ in range(ROUNDS):
        before = list(aligned)
        trusted = [p >= TRUSTED_PEAK for p in peaks]
        for i, clip in enumerate(before):
            others = [c for j, c in enumerate(before) if j != i and trusted[j]]
            if len(others) < 2:
                others = [c for j, c in enumerate(before) if j != i]
            curve = correlation_curve(clip, basis, fit(others, basis))
            aligned[i] = replace(clip, offset=_peak(curve))
            peaks[i] = float(curve.max())
    zero = float(np.median([c.offset for c in aligned if c.exact] or [0.0]))
    return [replace(c, offset=0.0 if c.exact else c.offset - zero) for c in aligned], peaks


def _peak(curve: np.ndarray) -> float:
    """Lag of the highest value of a curve (L,), between the lags by a parabola."""
    best = int(np.clip(curve.argmax(), 1, len(curve) - 2))
    low, middle, high = curve[best - 1 : best + 2]
    bend = low - 2 * middle + high
    part = np.clip((low - high) / (2 * bend), -0.5, 0.5) if bend < 0 else 0.0
    return float(LAGS[best] + part * (LAGS[1] - LAGS[0]))
