"""The face mask: the pixels that a dub replaces, the lower face and the region round its jaw.

Eyes with their lids and gaze, the nose, hair and ears are, like pose and background, those of the
film's frame, so a dub keeps their pixels. S side of the crop in px; lengths are for S = 512 and
scale with it.
"""

import math

import cv2
import numpy as np

from dubbing.face.face_contour import FaceContour, face_contour
from dubbing.face.mesh_points import (
    CHIN,
    FOREHEAD_TOP,
    LEFT_EYE_OUTER,
    NOSE_BASE,
    RIGHT_EYE_OUTER,
)
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.face.nose_region import nose_region
from dubbing.preparation.background.pixels import Part, around, extent
from dubbing.preparation.matting.matting import REFERENCE_SIZE

# Between these distances from the edge of the face, px, the film's own pixels take over: a model's
# errors are largest there.
INSIDE, OUTSIDE = 13.0, 3.0
# Between these heights across cheeks and nose the rendered head takes over: 0 on the line through
# the eyes, 1 at the base of the nose.
ABOVE, BELOW = 0.4, 0.8
# px beside the nose within which its own pixels fade: words hardly move it, light and nostrils are
# the film's. At most half of the way to the lips: of a head that nods little is between them.
BESIDE_NOSE = 12.0
UPPER_LIP_TOP = 0  # of FaceMesh
# Least length of that line, in eye distances: it is 0 for a nose that points at the camera.
SHORTEST = 0.3
# Between these distances of the eyes, in heights of the face, the line through them counts.
FROM_EYES = (0.1, 0.2)
# Between these distances from the mouth, in heights of the face, the film's own cheeks and jaw take
# over: they hardly move with words, and a turned head shows much of them. Downwards, where the chin
# moves, distances count less.
NEAR_MOUTH, FAR_FROM_MOUTH = 0.28, 0.4
DOWNWARDS = 1.3
# px beyond the mask that the composite depends on: feather, and smoothing of the neck's outlines.
AROUND = 24.0


def face_mask(landmarks: np.ndarray, contour: FaceContour) -> np.ndarray:
    """Share of each pixel that a rendered head may replace, (S, S) uint8.

    255 round the mouth and the chin, falling to 0 across the cheeks, across the rest of the face's
    edge, at the nose, and from the mouth up to the eyes.

    Args:
        landmarks: (478, 2) px.
        contour: of these.
    """
    size = len(contour.region)
    unit = size / REFERENCE_SIZE
    part = round_mouth(landmarks, size)
    lower = lower_share(landmarks, part) * beside_nose(landmarks, part, size)
    wide, own = around(part, math.ceil(INSIDE * unit) + 1, size)
    face = contour.region[wide]
    outside, inside = (
        cv2.distanceTransform(side, cv2.DIST_L2, 5)[own] for side in (255 - face, face)
    )
    near = np.clip((OUTSIDE * unit - outside + inside) / ((OUTSIDE + INSIDE) * unit), 0, 1)
    x, y = pixels_of(part)
    angles = np.arctan2(y - contour.middle[1], x - contour.middle[0])
    share = np.maximum(near, jaw_share(contour, angles))
    mask = np.zeros((size, size), np.uint8)
    mask[part] = (share * mouth_share(landmarks, part) * lower * 255).round()
    return mask


def beside_nose(landmarks: np.ndarray, part: Part, size: int) -> np.ndarray:
    """0 on the nose, 1 beside it from `BESIDE_NOSE` px on at the latest, (H, W) in a part."""
    other = (~nose_region(landmarks, size))[part].astype(np.uint8)
    if not other.size:
        return other
    away = cv2.distanceTransform(other, cv2.DIST_L2, 5)
    to_lips = float(np.linalg.norm(landmarks[UPPER_LIP_TOP] - landmarks[NOSE_BASE]))
    width = min(BESIDE_NOSE * size / REFERENCE_SIZE, to_lips / 2)
    return np.clip(away / max(width, 1.0), 0, 1)


def rendered_region(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Pixels (S, S) bool of a rendered head that a composite depends on; see `face_mask`."""
    mask, reach = (
        face_mask(landmarks, face_contour(landmarks, size)),
        AROUND * size / REFERENCE_SIZE,
    )
    out = np.zeros((size, size), bool)
    part = extent(mask > 0, math.ceil(reach))
    if mask[part].any():
        away = cv2.distanceTransform((mask[part] == 0).astype(np.uint8), cv2.DIST_L2, 5)
        out[part] = away <= reach
    return out


def lower_share(landmarks: np.ndarray, part: Part) -> np.ndarray:
    """0 above the cheeks, 1 below them, linear in between; (H, W) in rows and columns `part`."""
    return np.clip((way_down(landmarks, *pixels_of(part)) - ABOVE) / (BELOW - ABOVE), 0, 1)


def skull_share(landmarks: np.ndarray, part: Part) -> np.ndarray:
    """1 above the base of the nose, where no word moves the outline, 0 from the lips on; (H, W)."""
    lips = max(float(way_down(landmarks, *landmarks[UPPER_LIP_TOP].round())), 1 + SHORTEST)
    return np.clip((lips - way_down(landmarks, *pixels_of(part))) / (lips - 1), 0, 1)


def way_down(landmarks: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of places, px: 0 on the line through the eyes, 1 at the base of the nose."""
    left, right = landmarks[LEFT_EYE_OUTER], landmarks[RIGHT_EYE_OUTER]
    apart = max(float(np.linalg.norm(right - left)), 1.0)
    along = landmarks[CHIN] - landmarks[FOREHEAD_TOP]
    height = max(float(np.linalg.norm(along)), 1.0)
    # Eyes of a profile lie one before the other, and their line says nothing.
    none, all_ = FROM_EYES
    share = np.clip((apart / height - none) / (all_ - none), 0, 1)
    down = share * np.array([left[1] - right[1], right[0] - left[0]]) / apart
    down += (1 - share) * along / height
    down /= max(float(np.linalg.norm(down)), 1e-6)
    eyes = (left + right) / 2
    nose = max(float((landmarks[NOSE_BASE] - eyes) @ down), SHORTEST * apart)
    way: np.ndarray = ((x - eyes[0]) * down[0] + (y - eyes[1]) * down[1]) / nose
    return way


def round_mouth(landmarks: np.ndarray, size: int) -> Part:
    """Rows and columns of an image of side `size` that hold all of `mouth_share`."""
    face = max(float(np.linalg.norm(landmarks[FOREHEAD_TOP] - landmarks[CHIN])), 1.0)
    reach = FAR_FROM_MOUTH * DOWNWARDS * face
    x, y = landmarks[list(OUTER_LIP)].mean(0)
    rows, columns = (
        slice(*np.clip([math.floor(k - reach), math.ceil(k + reach) + 1], 0, size).tolist())
        for k in (y, x)
    )
    return rows, columns


def pixels_of(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Columns (W,) and rows (H, 1) of a part of an image, px."""
    rows, columns = (np.arange(i.start, i.stop, dtype=np.float32) for i in part)
    return columns, rows[:, None]


def mouth_share(landmarks: np.ndarray, part: Part) -> np.ndarray:
    """1 (H, W) round the mouth and the chin, 0 far from them, in rows and columns of an image."""
    above, beside = from_lips(landmarks, *pixels_of(part))
    away = np.hypot(beside, np.where(above < 0, above / DOWNWARDS, above))
    return np.clip((FAR_FROM_MOUTH - away) / (FAR_FROM_MOUTH - NEAR_MOUTH), 0, 1)


def from_lips(landmarks: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far places, px, lie above and beside the middle of the lips, in heights of the face."""
    up = landmarks[FOREHEAD_TOP] - landmarks[CHIN]
    up = up / max(float(up @ up), 1.0)
    middle = landmarks[list(OUTER_LIP)].mean(0)
    x, y = x - middle[0], y - middle[1]
    return x * up[0] + y * up[1], x * up[1] - y * up[0]


def jaw_share(contour: FaceContour, angles: np.ndarray) -> np.ndarray:
    """Share of pixels outside the face that may change, at angles (...) (rad) from its middle.

    1 round the jaw, which hinges below the ears, 0 beyond the cheeks and the forehead.
    """
    x, y = (contour.points - contour.middle).T
    return np.interp(angles, np.arctan2(y, x), contour.jaw_shares(), period=2 * np.pi)
