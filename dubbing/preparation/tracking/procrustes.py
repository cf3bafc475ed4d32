"""The mean head shape, by generalised Procrustes analysis (Gower 1975).

T frames, P points. Similarities map x to scale * rotation @ x + shift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubbing.face.mesh_points import (
    CHIN,
    FOREHEAD_TOP,
    LEFT_EAR,
    LEFT_EYE_OUTER,
    RIGHT_EAR,
    RIGHT_EYE_OUTER,
)

EYE_DISTANCE = 0.9  # between the outer eye corners; so that a unit is about 10 cm
ROUNDS = 5


@dataclass(frozen=True)
class Similarity:
    """x -> scale * rotation @ x + shift."""

    scale: float
    rotation: np.ndarray  # (3, 3)
    shift: np.ndarray  # (3,)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Moved points (P, 3)."""
        return self.scale * points @ self.rotation.T + self.shift


def best_similarity(source: np.ndarray, target: np.ndarray) -> Similarity:
    """Least-squares similarity from source (P, 3) to target (P, 3) (Umeyama 1991)."""
    source_mean, target_mean = source.mean(0), target.mean(0)
    a, b = source - source_mean, target - target_mean
    u, s, vt = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = (u * sign) @ vt
    scale = float((s * sign).sum() / (a**2).sum())
    return Similarity(scale, rotation, target_mean - scale * rotation @ source_mean)


def mean_shape(shapes: np.ndarray, fitted: tuple[int, ...]) -> np.ndarray:
    """Mean (P, 3) of shapes (T, P, 3) after each is aligned to it by its `fitted` points."""
    chosen = list(fitted)
    mean = shapes[len(shapes) // 2]
    for _ in range(ROUNDS):
        aligned = np.stack([best_similarity(s[chosen], mean[chosen])(s) for s in shapes])
        mean = np.median(aligned, axis=0)
    return mean


def head_frame(shape: np.ndarray) -> np.ndarray:
    """A FaceMesh shape (478, 3) in the head frame.

    x from the left to the right outer eye corner as seen by the camera, y down from the forehead
    to the chin, z forward from the camera; outer eye corners 0.9 apart; origin between the ears.
    """
    across = shape[RIGHT_EYE_OUTER] - shape[LEFT_EYE_OUTER]
    width = float(np.linalg.norm(across))
    x = across / width
    down = shape[CHIN] - shape[FOREHEAD_TOP]
    down = down - (down @ x) * x
    y = down / np.linalg.norm(down)
    axes = np.stack((x, y, np.cross(x, y)))
    origin = (shape[LEFT_EAR] + shape[RIGHT_EAR]) / 2
    return np.asarray((shape - origin) @ axes.T * (EYE_DISTANCE / width))
