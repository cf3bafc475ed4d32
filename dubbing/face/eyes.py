"""Where the eyes of a face are: their middle, and the axes that they give."""

import numpy as np


def eye_axes(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle (..., 2), unit vector to the right (..., 2) and distance (...) of the eyes.

    Args:
        corners: (..., 4, 2) px, in the order of `mesh_points.EYE_CORNERS`.
    """
    across = corners[..., 3, :] - corners[..., 0, :]
    apart = np.linalg.norm(across, axis=-1)
    return corners.mean(-2), across / apart[..., None], apart


def upwards(right: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 2) towards the forehead, perpendicular to those to the right."""
    return np.stack((right[..., 1], -right[..., 0]), axis=-1)
