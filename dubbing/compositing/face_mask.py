"""The face mask: the pixels that a dub replaces, the lower face and the region round its jaw.

Eyes with their lids and gaze, hair and ears are, like pose and background, those of the film's
frame, so a dub keeps their pixels. S side of the crop in px; lengths are for S = 512 and scale with
it.
"""

import cv2
import numpy as np

from dubbing.face.face_contour import face_contour, face_region
from dubbing.face.mesh_points import LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

# Between these distances from the edge of the face, px, the film's own pixels take over: a model's
# errors are largest there.
INSIDE, OUTSIDE = 13.0, 3.0
# Between these heights across cheeks and nose the rendered head takes over: 0 on the line through
# the eyes, 1 at the base of the nose.
ABOVE, BELOW = 0.4, 0.8
# Least length of that line, in eye distances: it is 0 for a nose that points at the camera.
SHORTEST = 0.3
# px beyond the mask that the composite depends on: feather, and smoothing of the neck's outlines.
AROUND = 24.0


def face_mask(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Share of each pixel that a rendered head may replace, (S, S) uint8.

    255 on the lower face and all round its jaw, falling to 0 across the rest of its edge and from
    the mouth up to the eyes.

    Args:
        landmarks: (478, 2) px.
        size: S.
    """
    face = face_region(landmarks, size)
    unit = size / REFERENCE_SIZE
    outside, inside = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (255 - face, face))
    near = np.clip((OUTSIDE * unit - outside + inside) / ((OUTSIDE + INSIDE) * unit), 0, 1)
    x, y = (np.arange(size) - middle for middle in face_middle(landmarks))
    share = np.maximum(near, jaw_share(landmarks, np.arctan2(y[:, None], x), size))
    return (share * lower_share(landmarks, size) * 255).round().astype(np.uint8)


def rendered_region(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Pixels (S, S) bool of a rendered head that a composite depends on; see `face_mask`."""
    return dilate(face_mask(landmarks, size) > 0, AROUND * size / REFERENCE_SIZE)


def lower_share(landmarks: np.ndarray, size: int) -> np.ndarray:
    """0 (S, S) above the cheeks, 1 below them, linear in between."""
    left, right = landmarks[LEFT_EYE_OUTER], landmarks[RIGHT_EYE_OUTER]
    apart = max(float(np.linalg.norm(right - left)), 1.0)
    down = np.array([left[1] - right[1], right[0] - left[0]]) / apart
    eyes = (left + right) / 2
    nose = max(float((landmarks[NOSE_BASE] - eyes) @ down), SHORTEST * apart)
    x, y = (np.arange(size) - place for place in eyes)
    way = (x * down[0] + y[:, None] * down[1]) / nose
    share: np.ndarray = np.clip((way - ABOVE) / (BELOW - ABOVE), 0, 1)
    return share


def face_middle(landmarks: np.ndarray) -> np.ndarray:
    """Middle (2,) of the box round the face, px."""
    middle: np.ndarray = (landmarks.min(0) + landmarks.max(0)) / 2
    return middle


def jaw_share(landmarks: np.ndarray, angles: np.ndarray, size: int) -> np.ndarray:
    """Share of pixels outside the face that may change, at angles (...) (rad) from its middle.

    1 round the jaw, which hinges below the ears, 0 beyond the cheeks and the forehead.
    """
    contour = face_contour(landmarks, size)
    x, y = (contour.points - face_middle(landmarks)).T
    return np.interp(angles, np.arctan2(y, x), contour.jaw_shares(), period=2 * np.pi)
