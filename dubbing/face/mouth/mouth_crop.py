"""Crops of the mouth, stabilised against the motion of the head.

Letters: F frames, H and W pixels of the image, R = 36 rows and C = 48 columns of a crop.

A crop is a rectangle of the canonical face's plane through the lips, sampled where the head's pose
puts it: a turned or tilted head gives the same crop, as far as a plane can.
"""

from collections.abc import Iterable

import cv2
import numpy as np

from dubbing.face.mouth.mouth_shape import RIGID
from dubbing.face.mouth.similarity import similarity

ROWS, COLUMNS = 36, 48
# Middle of the rectangle on the canonical face (right, down, away) and its pitch, eye distances. It
# extends from under the nose to the chin, and half a lip's width beyond both corners of the mouth.
MIDDLE = np.array([0.045, 0.95, -0.19])
PITCH = 0.019


def mouth_crop(frame: np.ndarray, points: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Grey crop of one mouth, (R, C) uint8.

    Args:
        frame: (H, W, 3) RGB uint8; its edges are replicated outside.
        points: mesh (478, 3) in its pixels.
        face: the canonical `RIGID` points (K, 3).
    """
    rigid = points[None, list(RIGID)].astype(np.float64)
    scale, rotation, translation = similarity(rigid, face.astype(np.float64))
    # Canonical points are c = scale * rotation @ p + translation; this is the way back.
    back = rotation[0].T[:2] / scale[0]
    # Several samples a pixel where the image is finer than the crop, so that nothing aliases.
    fine = int(np.clip(np.ceil(PITCH / scale[0]), 1, 8))
    pitch = PITCH / fine
    corner = MIDDLE - translation[0]
    corner[0] -= pitch * (COLUMNS * fine - 1) / 2
    corner[1] -= pitch * (ROWS * fine - 1) / 2
    laid = np.column_stack([back[:, :2] * pitch, back @ corner])
    size = (COLUMNS * fine, ROWS * fine)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    # Only the pixels under the crop are converted to grey.
    ends = np.array([[0, 0, 1], [size[0], 0, 1], [0, size[1], 1], [*size, 1]]) @ laid.T
    high = np.array([frame.shape[1], frame.shape[0]])
    low = np.clip(np.floor(ends.min(0)).astype(int) - 1, 0, high - 1)
    high = np.clip(np.ceil(ends.max(0)).astype(int) + 2, low + 1, high)
    grey = cv2.cvtColor(frame[low[1] : high[1], low[0] : high[0]], cv2.COLOR_RGB2GRAY)
    laid[:, 2] -= low
    fine_crop = cv2.warpAffine(grey, laid, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return cv2.resize(fine_crop, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)


def mouth_crops(frames: Iterable[np.ndarray], meshes: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Crops (F, R, C) uint8 of frames whose meshes (F, 478, 3) are known; 0 where those are NaN."""
    crops = np.zeros((len(meshes), ROWS, COLUMNS), np.uint8)
    for k, (frame, points) in enumerate(zip(frames, meshes, strict=False)):
        if np.isfinite(points).all():
            crops[k] = mouth_crop(frame, points, face)
    return crops
