"""Lip measures: a few distances between landmarks. T frames."""

from __future__ import annotations

import numpy as np

from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER

# Inner gap in the middle, left and right; width; base of the nose to lower lip, upper lip and chin.
LIP_DISTANCES = ((13, 14), (81, 178), (311, 402), (61, 291), (2, 17), (2, 0), (2, 152))
TOUCHING = 0.02  # inner lips nearer than this, in eye distances, touch


def lip_lengths(landmarks: np.ndarray) -> np.ndarray:
    """Distances between points of the lips, the chin and the base of the nose, (T, 7).

    In units of the distance between the eyes, from landmarks (T, 478, 2).
    """
    eyes = np.linalg.norm(landmarks[:, LEFT_EYE_OUTER] - landmarks[:, RIGHT_EYE_OUTER], axis=-1)
    first, second = np.array(LIP_DISTANCES).T
    lengths = np.linalg.norm(landmarks[:, first] - landmarks[:, second], axis=-1) / eyes[:, None]
    return np.asarray(lengths)


def standardised(values: np.ndarray) -> np.ndarray:
    """Each column of (T, K) with mean 0 and variance 1."""
    return np.asarray((values - values.mean(0)) / (values.std(0) + 1e-6))


def lip_measures(landmarks: np.ndarray) -> np.ndarray:
    """Lip measures (T, 7), each of mean 0 and variance 1, from landmarks (T, 478, 2)."""
    return standardised(lip_lengths(landmarks))


def lips_touch(landmarks: np.ndarray, eyes: np.ndarray | None = None) -> np.ndarray:
    """Whether the inner lips touch in the middle, (T,) bool.

    Args:
        landmarks: (T, 478, 2) as the picture shows them.
        eyes: (T,) distance of the eyes of a head that may be turned; None: as landmarks show it.
    """
    upper, lower = LIP_DISTANCES[0]
    gap = np.linalg.norm(landmarks[:, upper] - landmarks[:, lower], axis=-1)
    if eyes is None:
        eyes = np.linalg.norm(landmarks[:, LEFT_EYE_OUTER] - landmarks[:, RIGHT_EYE_OUTER], axis=-1)
    return np.asarray(gap < TOUCHING * eyes)
