"""How well a linear map predicts the lips from speech features, for people it was not trained on.

Ridge regression from the features of +-0.24 s to the opening and the width of the mouth, each
standardised a person; trained on all people but one, and correlated with that one's lips.

Letters: F frames, T steps of 20 ms, D feature values, C = 13 moments of context, P people.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.face.mouth.lip_measures import lip_measures
from dubbing.face.mouth.mouth_shape import canonical_face
from dubbing.speech.voice_activity import at_times
from dubbing.workshop.training.sync.clips import Recording, laid_on, recorded
from dubbing.workshop.training.sync.correlation import align

MEASURES = ("opening", "width")
# Places of the two in `dubbing.face.mouth.lip_measures.LIP_DISTANCES`.
_COLUMNS = (0, 3)
# Context: 0.24 s each way in steps of a frame at 25 fps.
CONTEXT = np.arange(-6, 7) * 0.04
# Strengths of the ridge, in units of the mean variance of a regressor times the number of frames.
STRENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


@dataclass(frozen=True)
class Speaker:
    """Lips (F, 2) of a person, and when in the sound they belong, `times` (F,) in seconds."""

    name: str
    path: Path
    lips: np.ndarray
    times: np.ndarray


def speakers(paths: Sequence[Path], cache: Path | None = None) -> list[Speaker]:
    """Measures clips of one talking person each; their own sound offsets are taken out.

    Raises:
        ValueError: fewer than three clips (own offsets are found by comparison).
        SyncError: a clip shows no face.
    """
    recordings = [recorded(path, cache) for path in paths]
    face = canonical_face(r.meshes for r in recordings)
    aligned, _ = align(laid_on(recordings, face, pixels=False))
    return [
        _speaker(path, recording, clip.offset)
        for path, recording, clip in zip(paths, recordings, aligned, strict=True)
    ]


def _speaker(path: Path, recording: Recording, offset: float) -> Speaker:
    visible = np.isfinite(recording.meshes[:, 0, 0])
    lips = lip_measures(recording.meshes[visible, :, :2].astype(np.float64))[:, _COLUMNS]
    return Speaker(path.stem, path, lips, recording.times[visible] + offset)


def regressors(features: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Features (T, D) around each moment (F,), (F, C D) with mean 0 over the person."""
    around = at_times(features, times[:, None] + CONTEXT).reshape(len(times), -1)
    return (around - around.mean(0)).astype(np.float64)


@dataclass(frozen=True)
class Sums:
    """A person's sums for ridge regression: X'X, X'Y and the number of frames."""

    xx: np.ndarray
    xy: np.ndarray
    frames: int


def sums(x: np.ndarray, y: np.ndarray) -> Sums:
    return Sums(x.T @ x, x.T @ y, len(x))


def ridge(parts: Sequence[Sums]) -> list[np.ndarray]:
    """Weights (C D, 2) for each of STRENGTHS, from several people's sums."""
    xx = np.sum([p.xx for p in parts], 0)
    xy = np.sum([p.xy for p in parts], 0)
    values, vectors = np.linalg.eigh(xx)
    turned = vectors.T @ xy
    unit = float(np.trace(xx)) / len(xx)
    return [vectors @ (turned / (values + s * unit)[:, None]) for s in STRENGTHS]


def correlations(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Correlations (2,) of the predicted measures with the true ones."""
    predicted = x @ weights
    return np.array([np.corrcoef(predicted[:, k], y[:, k])[0, 1] for k in range(y.shape[1])])


@dataclass(frozen=True)
class Fit:
    """Sums of all people, and each one's correlations (strengths, P, 2) when left out."""

    parts: list[Sums]
    by_strength: np.ndarray

    @property
    def best(self) -> np.ndarray:
        """Which strength serves all people best, for each measure, (2,)."""
        return self.by_strength.mean(1).argmax(0)

    @property
    def left_out(self) -> np.ndarray:
        """Correlations (P, 2) with each person left out, at the best strengths."""
        return np.stack([self.by_strength[self.best[m], :, m] for m in range(len(MEASURES))], 1)


def fit(people: Sequence[Speaker], features: Sequence[np.ndarray]) -> Fit:
    xs = [regressors(f, p.times) for f, p in zip(features, people, strict=True)]
    parts = [sums(x, p.lips) for x, p in zip(xs, people, strict=True)]
    by_strength = np.zeros((len(STRENGTHS), len(people), len(MEASURES)))
    for k, person in enumerate(people):
        for s, weights in enumerate(ridge(parts[:k] + parts[k + 1 :])):
            by_strength[s, k] = correlations(xs[k], person.lips, weights)
    return Fit(parts, by_strength)


def unseen(fitted: Fit, tests: Sequence[Speaker], features: Sequence[np.ndarray]) -> np.ndarray:
    """Correlations (tests, 2) of the ridge of all people, on others."""
    weights = ridge(fitted.parts)
    rows = []
    for test, series in zip(tests, features, strict=True):
        x = regressors(series, test.times)
        by_strength = [correlations(x, test.lips, w) for w in weights]
        rows.append([by_strength[fitted.best[m]][m] for m in range(len(MEASURES))])
    return np.array(rows)
