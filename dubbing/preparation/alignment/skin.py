"""Points of the upper face's skin, with depth from the mean shape.

N points, in the head frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from dubbing.face.mesh_points import LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW, UPPER_FACE
from dubbing.preparation.alignment.camera import Poses, project, to_camera, vector_from_rotation

EYE_MARGIN = 0.03  # face widths around eyes and brows that are left out
EYES_AND_BROWS = (LEFT_EYE_AND_BROW, RIGHT_EYE_AND_BROW)
MOST_POINTS = 5000


@dataclass(frozen=True)
class Skin:
    """points (N, 3) of the head frame and their unit normals (N, 3)."""

    points: np.ndarray
    normals: np.ndarray

    def half(self, which: int) -> Skin:
        """Every second point: 0 the even, 1 the odd ones."""
        return Skin(self.points[which::2], self.normals[which::2])


def reference_frame(poses: Poses, usable: np.ndarray) -> int:
    """The usable frame whose pose is nearest to the median pose."""
    vectors = vector_from_rotation(poses.rotation[usable])
    state = np.concatenate((vectors * 5, poses.translation[usable]), axis=1)
    distance = np.linalg.norm(state - np.median(state, axis=0), axis=1)
    return int(np.flatnonzero(usable)[distance.argmin()])


def skin_mask(
    pixels: np.ndarray, size: int, outline: tuple[int, ...], holes: tuple[tuple[int, ...], ...]
) -> np.ndarray:
    """Pixels (S, S) bool inside an outline without its holes; landmarks (478, 2) px."""
    mask = np.zeros((size, size), np.uint8)
    cv2.fillPoly(mask, [pixels[list(outline)].round().astype(np.int32)], 1)
    margin = max(1, round(EYE_MARGIN * float(np.ptp(pixels[:, 0]))))
    for hole in holes:
        hull = cv2.convexHull(pixels[list(hole)].astype(np.float32))[:, 0]
        out = np.zeros_like(mask)
        cv2.fillConvexPoly(out, hull.round().astype(np.int32), 1)
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
        mask[cv2.dilate(out, disc) > 0] = 0
    return mask > 0


def skin_points(
    shape: np.ndarray,
    pose: Poses,
    focal: float,
    centre: np.ndarray,
    size: int,
    *,
    outline: tuple[int, ...] = UPPER_FACE,
    holes: tuple[tuple[int, ...], ...] = EYES_AND_BROWS,
) -> Skin:
    """Back-project the pixels of one frame onto the shape (478, 3): by default the rigid skin.

    Args:
        pose: of that frame, (1,). centre: (1, 2) px.
        outline, holes: landmarks round the part wanted, and round the parts left out of it.
    """
    in_camera = to_camera(pose, shape)[0]
    pixels = project(in_camera[None], focal, centre)[0]
    mesh = Delaunay(pixels)
    normals = vertex_normals(in_camera, mesh.simplices)
    surface = LinearNDInterpolator(mesh, np.concatenate((in_camera[:, 2:], normals), axis=1))
    rows, columns = np.nonzero(skin_mask(pixels, size, outline, holes))
    stride = max(1, round(np.sqrt(len(rows) / MOST_POINTS)))
    kept = (rows % stride == 0) & (columns % stride == 0)
    at = np.stack((columns[kept], rows[kept]), axis=1).astype(np.float64)
    values = surface(at)
    known = np.isfinite(values[:, 0])
    at, values = at[known], values[known]
    depth = values[:, :1]
    points = np.concatenate(((at - centre[0]) / focal * depth, depth), axis=1)
    unit = values[:, 1:] / np.linalg.norm(values[:, 1:], axis=1, keepdims=True)
    return Skin((points - pose.translation[0]) @ pose.rotation[0], unit @ pose.rotation[0])


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Normals (P, 3) towards the camera of points (P, 3) in the camera, by area-weighted mean."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal *= -np.sign(normal[:, 2:])
    out = np.zeros_like(points)
    for k in range(3):
        np.add.at(out, triangles[:, k], normal)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
