"""Where a picture shows the nose."""

import cv2
import numpy as np

from dubbing.face.mesh_points import NOSE


def nose_region(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Pixels of the nose below its bridge, (size, size) bool.

    Args:
        landmarks: (478, 2) px.
    """
    nose = np.zeros((size, size), np.uint8)
    outline = cv2.convexHull(landmarks[list(NOSE)].round().astype(np.int32))
    cv2.fillConvexPoly(nose, outline, 1)
    return nose > 0
