"""A graphic over a face: what is detected of it, and its places in a mask. S is the side in px."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import FACE_OVAL
from dubbing.face.mouth.mouth_shape import INNER_LIP

LIPS = 0.08  # eye distances round the inner lips, where teeth and tongue have any colour
COLOURS = 3  # of a graphic
MOST_PIXELS = 4000  # from which these are clustered
OUTLINED = (
    0.5  # of the pixels at a distance from letters have unusual colours, if an outline is there
)
HOLE = 0.1  # of a graphic: what is less has the colours of skin by chance


@dataclass(frozen=True)
class Detection:
    """Unusual colours in one frame.

    Their first and last row (px of the crop), colours (N, 3), and whether they touch the mouth.
    """

    frame: int
    top: int
    bottom: int
    colours: np.ndarray
    at_mouth: bool


def main_colours(detections: Sequence[Detection]) -> np.ndarray:
    """The main colours (K, 3) of detections, by k-means."""
    if not detections:
        return np.zeros((0, 3), np.float32)
    pixels = np.concatenate([detection.colours for detection in detections])
    pixels = np.ascontiguousarray(pixels[:: len(pixels) // MOST_PIXELS + 1])
    if len(pixels) <= COLOURS:
        return pixels
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 1.0)
    cv2.setRNGSeed(0)
    labels = np.zeros((len(pixels), 1), np.int32)
    flags = cv2.KMEANS_PP_CENTERS
    _, _, centres = cv2.kmeans(pixels, COLOURS, labels, criteria, 1, flags)
    return np.asarray(centres)


def mouth(points: np.ndarray, eyes: float, shape: tuple[int, ...]) -> np.ndarray:
    """Pixels (H, W) bool between the lips and close to them, of a face with points (P, 2) px.

    Args:
        eyes: distance between the outer corners of the eyes, px. shape: (H, W).
    """
    inner = np.zeros(shape, np.uint8)
    cv2.fillPoly(inner, [points[list(INNER_LIP), :2].round().astype(np.int32)], 1)
    reach = max(1, round(LIPS * eyes))
    return cv2.dilate(inner, np.ones((2 * reach + 1, 2 * reach + 1))) > 0


def ycc(pixels: np.ndarray) -> np.ndarray:
    """RGB (..., 3) uint8 as Y, Cr, Cb float32."""
    flat = pixels.reshape(1, -1, 3)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2YCrCb).reshape(pixels.shape), np.float32)


def outline(letters: np.ndarray, bare: np.ndarray, odd: np.ndarray, most: int) -> int:
    """Px that the outline of letters is wide, where skin is round them; 1 at least, an edge.

    Args:
        letters: (S, S) uint8, 1 there. bare: (S, S) bool, skin. odd: of it what has unusual
            colours. most: px, at most.
    """
    away = cv2.distanceTransform(1 - letters, cv2.DIST_L2, 3)
    for width in range(most, 1, -1):
        ring = bare & (away > width - 1) & (away <= width)
        if ring.any() and odd[ring].mean() > OUTLINED:
            return width
    return 1


def without_holes(mask: np.ndarray) -> np.ndarray:
    """A mask (S, S) uint8 whose parts have no small holes."""
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    for k, contour in enumerate(contours):
        outside = tree[0, k, 3]
        if outside >= 0 and cv2.contourArea(contour) < HOLE * cv2.contourArea(contours[outside]):
            cv2.drawContours(mask, contours, k, 1, cv2.FILLED)
    return mask


def over_face(mask: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pixels (S, S) bool of the components of a mask that extend into the face."""
    face = np.zeros_like(mask)
    cv2.fillPoly(face, [points[list(FACE_OVAL), :2].round().astype(np.int32)], 1)
    _, piece = cv2.connectedComponents(mask)
    return np.isin(piece, np.setdiff1d(piece[(face > 0) & (mask > 0)], 0))
