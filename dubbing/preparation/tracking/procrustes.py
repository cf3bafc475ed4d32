"""The mean head shape, by generalised Procrustes analysis (Gower 1975).

T frames, P points.
"""

import numpy as np

from dubbing.face.mesh_points import (
    CHIN,
    FOREHEAD_TOP,
    LEFT_EAR,
    LEFT_EYE_OUTER,
    RIGHT_EAR,
    RIGHT_EYE_OUTER,
)
from dubbing.face.mouth.similarity import similarity

EYE_DISTANCE = 0.9  # between the outer eye corners; so that a unit is about 10 cm
ROUNDS = 5


def mean_shape(shapes: np.ndarray, fitted: tuple[int, ...]) -> np.ndarray:
    """Mean (P, 3) of shapes (T, P, 3) after each is aligned to it by its `fitted` points."""
    chosen = list(fitted)
    mean = shapes[len(shapes) // 2]
    for _ in range(ROUNDS):
        aligned = similarity(shapes[:, chosen], mean[chosen])(shapes)
        mean = np.median(aligned, axis=0)
    return mean


def head_frame(shape: np.ndarray) -> np.ndarray:
    """A FaceMesh shape (478, 3) in the head frame.

    x from the left to the right outer eye corner as seen by the camera, y down from the forehead
    to the chin, z forward from the camera; outer eye corners 0.9 apart; origin between the ears.

    Raises:
        numpy.linalg.LinAlgError: the corners of the eyes are one point.
    """
    across = shape[RIGHT_EYE_OUTER] - shape[LEFT_EYE_OUTER]
    width = float(np.linalg.norm(across))
    if not width:
        raise np.linalg.LinAlgError("the corners of the eyes are one point")
    x = across / width
    down = shape[CHIN] - shape[FOREHEAD_TOP]
    down = down - (down @ x) * x
    y = down / np.linalg.norm(down)
    axes = np.stack((x, y, np.cross(x, y)))
    origin = (shape[LEFT_EAR] + shape[RIGHT_EAR]) / 2
    return np.asarray((shape - origin) @ axes.T * (EYE_DISTANCE / width))
