"""Where a picture shows the lips."""

import cv2
import numpy as np

from dubbing.face.mouth.mouth_shape import OUTER_LIP


def lip_region(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Pixels of the lips and of what is between them, (size, size) bool.

    Args:
        landmarks: (478, 2) px.
    """
    lips = np.zeros((size, size), np.uint8)
    cv2.fillPoly(lips, [landmarks[list(OUTER_LIP)].round().astype(np.int32)], 1)
    return lips > 0
