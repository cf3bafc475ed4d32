"""Similarities that align many point sets to one: rotation, scale and translation, no mirroring.

Letters: T point sets, K points.
"""

from typing import NamedTuple

import numpy as np


class Similarity(NamedTuple):
    """Takes points x to scale * rotation @ x + translation."""

    scale: np.ndarray  # (T,)
    rotation: np.ndarray  # (T, 3, 3)
    translation: np.ndarray  # (T, 3)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Moved points (T, K, 3)."""
        turned = np.einsum("tij,tkj->tki", self.rotation, points)
        return self.scale[:, None, None] * turned + self.translation[:, None]


def similarity(points: np.ndarray, target: np.ndarray) -> Similarity:
    """Least-squares similarity that aligns each of `points` (T, K, 3) to `target` (K, 3).

    Umeyama 1991.
    """
    middle, goal = points.mean(1), target.mean(0)
    centred, aim = points - middle[:, None], target - goal
    u, s, vt = np.linalg.svd(np.einsum("ki,tkj->tij", aim, centred))
    flip = np.sign(np.linalg.det(u @ vt))
    s[:, 2] *= flip
    u[:, :, 2] *= flip[:, None]
    rotation = u @ vt
    scale = s.sum(1) / np.maximum((centred**2).sum((1, 2)), 1e-12)
    translation = goal - scale[:, None] * np.einsum("tij,tj->ti", rotation, middle)
    return Similarity(scale, rotation, translation)
