"""The surface of a head: the mesh of its face, and an ellipsoid behind it.

P points; head frame as in :class:`PreparedClip`, y down, the face along -z.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import NOSE_BASE
from dubbing.face.mesh_triangles import TRIANGLES

CENTRE, RADII = np.array([0.0, -0.1, 0.05]), 0.9 * np.array([0.85, 1.25, 1.05])  # the ellipsoid
BELOW_NOSE = 0.02  # units: from there on words move the skin of the face
LEAST_FACING = 0.4  # cosine between the surface and the way to the camera
SHIFT = 4  # fractional bits of the coordinates that OpenCV draws at


@dataclass(frozen=True)
class HeadSurface:
    """The surface of a person's head.

    Attributes:
        shape: (478, 3) mesh of the face. focal: px of the camera.
    """

    shape: np.ndarray
    focal: float

    def lifted(
        self, pixels: np.ndarray, rotation: np.ndarray, shift: np.ndarray, centre: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places (P, 3) of pixels (P, 2), and which of them are firm on the skull and face us.

        Args:
            rotation, shift: pose of the head. centre: (2,) principal point, px.
        """
        rays = np.concatenate([(pixels - centre) / self.focal, np.ones((len(pixels), 1))], 1)
        origin, rays = -rotation.T @ shift, rays @ rotation
        a, b = (origin - CENTRE) / RADII, rays / RADII
        squared, mixed = (b * b).sum(1), b @ a
        root = mixed**2 - squared * (a @ a - 1)
        skull = np.where(root > 0, (-mixed - np.sqrt(np.maximum(root, 0))) / squared, np.inf)
        face, normal = self._face(pixels, rotation, shift, centre)
        depth = np.minimum(skull, face)
        places = origin + np.where(np.isfinite(depth), depth, 0)[:, None] * rays
        outward = (places - CENTRE) / RADII**2
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        outward = np.where((face < skull)[:, None], normal, outward)
        facing = -(outward * rays).sum(1) / np.linalg.norm(rays, axis=1)
        below = places[:, 1] > self.shape[NOSE_BASE, 1] + BELOW_NOSE
        speaks = below & (places[:, 2] < CENTRE[2])
        return places, np.isfinite(depth) & ~speaks & (facing > LEAST_FACING)

    def _face(
        self, pixels: np.ndarray, rotation: np.ndarray, shift: np.ndarray, centre: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Depth (P,) of the mesh at pixels, infinite beside it, and its normals (P, 3) there."""
        in_camera = self.shape @ rotation.T + shift
        seen = self.focal * in_camera[:, :2] / in_camera[:, 2:] + centre
        corners = TRIANGLES
        low = np.floor(seen[:468].min(0)).astype(int)
        wide, high = np.maximum(np.ceil(seen[:468].max(0)).astype(int) - low + 1, 1)
        number = np.full((high, wide), -1.0, np.float32)
        depth = in_camera[corners, 2].mean(1)
        flat = ((seen[corners] - low) * (1 << SHIFT)).round().astype(np.int32)
        for k in np.argsort(-depth).tolist():  # the nearest comes last
            cv2.fillConvexPoly(number, flat[k], float(k), shift=SHIFT)
        at = (pixels - low).round().astype(int)
        inside = ((at >= 0) & (at < (wide, high))).all(1)
        which = np.full(len(pixels), -1)
        which[inside] = number[at[inside, 1], at[inside, 0]].astype(int)
        a, b, c = (self.shape[corners[which, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal *= -np.sign(normal[:, 2:])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        return np.where(which >= 0, depth[which], np.inf), normal
