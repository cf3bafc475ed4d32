"""What of a picture speech can change: the face, and the room round its jaw.

Hair, ears and what is behind them are, like pose and background, those of the frame of the clip
whose place is taken, so a dub keeps their pixels. S side of the crop in px; lengths are for S = 512
and scale with it.
"""

from __future__ import annotations

import cv2
import numpy as np

from dubbing.face.mesh_points import FACE_OVAL
from dubbing.preparation.matting.matting import REFERENCE_SIZE

# From where to where the clip's own pixels take over, px from the edge of the face: what a model
# gets wrong lies along it first.
INSIDE, OUTSIDE = 13.0, 3.0
CHIN = FACE_OVAL.index(152)
# Points of the oval to each side of the chin round which all may change. The jaw hangs on hinges
# below the ears: further up its edge hardly moves. In between it fades.
JAW, CHEEK = 4, 6


def face_mask(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Share of each pixel that a rendered head may replace, (S, S) uint8.

    255 on the face and all round its jaw, falling to 0 across the rest of its edge.

    Args:
        landmarks: (478, 2) px.
        size: S.
    """
    oval = landmarks[list(FACE_OVAL)]
    shift = 4  # fractional bits of the coordinates that OpenCV draws at
    face = np.zeros((size, size), np.uint8)
    cv2.fillPoly(face, [(oval * (1 << shift)).round().astype(np.int32)], 255, shift=shift)
    unit = size / REFERENCE_SIZE
    outside, inside = (cv2.distanceTransform(part, cv2.DIST_L2, 5) for part in (255 - face, face))
    near = np.clip((OUTSIDE * unit - outside + inside) / ((OUTSIDE + INSIDE) * unit), 0, 1)
    below = np.abs(np.arange(len(FACE_OVAL)) - CHIN)
    jaw = np.clip((CHEEK - below) / (CHEEK - JAW), 0, 1)
    x, y = (np.arange(size) - middle for middle in oval.mean(0))
    towards = np.arctan2(y[:, None], x)
    sides = np.arctan2(*(oval - oval.mean(0)).T[::-1])
    share = np.maximum(near, np.interp(towards, sides, jaw, period=2 * np.pi))
    return (share * 255).round().astype(np.uint8)
