"""Rotations as vectors of angle times axis, many at a time (Rodrigues' formula).

T rotations.
"""

import numpy as np
from scipy.spatial.transform import Rotation


def rotation_from_vector(vector: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, 3) in radians to matrices (T, 3, 3)."""
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def vector_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Rotation matrices (T, 3, 3) to rotation vectors (T, 3) in radians."""
    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())


def cross_matrix(vector: np.ndarray) -> np.ndarray:
    """Matrices (..., 3, 3) whose product with y is the cross product of vector (..., 3) and y."""
    out = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out[..., 0, 1], out[..., 0, 2] = -z, y
    out[..., 1, 0], out[..., 1, 2] = z, -x
    out[..., 2, 0], out[..., 2, 1] = -y, x
    return out


def relative_vectors(rotation: np.ndarray) -> np.ndarray:
    """Turn from each frame to the next, log(R_{t+1} R_t^T): (T, 3, 3) to (T - 1, 3), radians."""
    return vector_from_rotation(rotation[1:] @ rotation[:-1].transpose(0, 2, 1))
