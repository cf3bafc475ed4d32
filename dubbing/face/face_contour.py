"""The contour of a face as the picture shows it: the outline of its whole mesh.

From the front it is the oval of the mesh. The further a head turns, the more of the oval lies
behind cheek and nose, and other points of the mesh make the contour. Where a jaw is told from a
cheek, heights along the face count, as they do not change when it turns.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import CHIN, FACE_OVAL, FOREHEAD_TOP, JAW
from dubbing.face.mesh_triangles import TRIANGLES

SHIFT = 4  # fractional bits of the coordinates that OpenCV draws at
# Of points of the jaw, how far from the chin they are on the oval.
CORNERS = JAW[4], JAW[-5]  # up to here everything may change when a jaw moves
CHEEKS = JAW[2], JAW[-3]  # from here on nothing does
LOBES = JAW[1], JAW[-2]  # the last ones below the ears


def face_region(landmarks: np.ndarray, size: int, margin: int = 0) -> np.ndarray:
    """Pixels of the mesh, 255, and others, 0, (size + 2 margin,) * 2 uint8.

    Args:
        landmarks: (478, 2) px.
        size: side of the image. margin: px of the result round it.
    """
    face = np.zeros((size + 2 * margin,) * 2, np.uint8)
    corners = ((landmarks + margin) * (1 << SHIFT)).round().astype(np.int32)
    for triangle in corners[TRIANGLES]:
        cv2.fillConvexPoly(face, triangle, 255, shift=SHIFT)
    return face


@dataclass(frozen=True)
class FaceContour:
    """The contour of a face.

    Attributes:
        region: (S, S) uint8, see `face_region`.
        middle: (2,) of the box round the face, px.
        points: (P, 2) px, clockwise.
        heights: (P,) above the chin, in heights of the face.
        corners, cheeks, lobes: heights at which the jaw begins to be still, is still, and ends;
            at the left and at the right of the image.
    """

    region: np.ndarray
    middle: np.ndarray
    points: np.ndarray
    heights: np.ndarray
    corners: np.ndarray
    cheeks: np.ndarray
    lobes: np.ndarray

    def jaw_shares(self) -> np.ndarray:
        """Share of each point's surroundings that may change when a jaw moves, (P,) 1..0."""
        corner, cheek = self.corners.mean(), self.cheeks.mean()
        return np.clip((cheek - self.heights) / max(cheek - corner, 1e-6), 0, 1)

    def jaw(self) -> np.ndarray:
        """The part of the contour from the left over the chin to the right, (K, 2) px.

        It ends at both sides below the ears, or at that height.
        """
        chin = int(self.heights.argmin())
        count = len(self.points)
        after = np.roll(self.heights, -chin)
        left, right = (
            int(np.argmax(way >= limit)) if (way >= limit).any() else count // 2
            for way, limit in ((after, self.lobes[0]), (after[::-1], self.lobes[1]))
        )
        index = np.arange(chin + left, chin - right - 2, -1) % count
        return self.points[index]

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point (2,) px lies inside."""
        x, y = point.tolist()
        return cv2.pointPolygonTest(self.points.astype(np.float32), (x, y), False) > 0


def evenly(line: np.ndarray, count: int) -> np.ndarray:
    """A line (K, 2) px as `count` points evenly spaced along it."""
    length = np.concatenate(([0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()))
    at = np.linspace(0, length[-1], count)
    return np.stack([np.interp(at, length, line[:, k]) for k in range(2)], axis=1)


def face_contour(landmarks: np.ndarray, size: int) -> FaceContour:
    """The contour of a face with landmarks (478, 2) px in an image of side `size`."""
    oval = landmarks[list(FACE_OVAL)]
    margin = min(int(max(0, -oval.min(), (oval - size).max())) + 2, size)
    region = face_region(landmarks, size, margin)
    found, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not found:  # the face lies far outside of the image
        points = oval.astype(np.float64)
    else:
        points = max(found, key=len)[:, 0].astype(np.float64) - margin
    if cv2.contourArea(points.astype(np.float32), oriented=True) < 0:
        points = points[::-1]
    up = landmarks[FOREHEAD_TOP] - landmarks[CHIN]
    up = up / max(float(up @ up), 1e-6)

    def height(at: np.ndarray) -> np.ndarray:
        return np.asarray((at - landmarks[CHIN]) @ up)

    marks = (height(landmarks[list(pair)]) for pair in (CORNERS, CHEEKS, LOBES))
    inside = region[margin:-margin, margin:-margin]
    middle = (landmarks.min(0) + landmarks.max(0)) / 2
    return FaceContour(np.ascontiguousarray(inside), middle, points, height(points), *marks)
