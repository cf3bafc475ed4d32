"""Landmarks of faces in regions of images: FaceMesh with attention.

Grishchenko et al. 2020, "Attention Mesh: High-fidelity Face Mesh Prediction in Real-time": a mesh
of 468 points; lips and eyes are looked at again, and the irises added.

Letters: R regions.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from dubbing.face.finding.graph_network import GraphNetwork
from dubbing.face.finding.regions import Region
from dubbing.face.mesh_points import LANDMARKS

SIZE = 192  # px, side of the network's input
BATCH = 4  # regions at once: more do not fit a core's cache
MESH = 468  # points without irises
IRIS = 5  # points
RIM = 16  # points of an eye that lie on its lids; their depth is the iris's
LEAST = 0.0  # logarithm of the odds that a region shows a face


class LandmarkNetwork:
    """Points of faces, by the network of `face_landmarks.safetensors`."""

    def __init__(self, network: GraphNetwork) -> None:
        self._network = network
        # What is looked at again: lips, left eye and right eye, by numbers of their points.
        (self._refined,) = (step["points"] for step in network.graph if step["op"] == "box")

    def __call__(self, looks: Sequence[tuple[np.ndarray, Region]]) -> list[np.ndarray | None]:
        """Points (478, 3) px of the face in each region of an image; None without a face.

        Args:
            looks: R images (H, W, 3) uint8 RGB, each with a region.
        """
        return [points if sure > LEAST else None for points, sure in self.doubted(looks)]

    def doubted(self, looks: Sequence[tuple[np.ndarray, Region]]) -> list[tuple[np.ndarray, float]]:
        """The same with the logarithm of the odds that it is a face, whatever they are."""
        found: list[tuple[np.ndarray, float]] = []
        for start in range(0, len(looks), BATCH):
            part = looks[start : start + BATCH]
            inputs = np.stack([r.cut(image, SIZE, cv2.BORDER_REPLICATE) for image, r in part])
            *values, logits = self._network(inputs)
            meshes = self._points([v.reshape(len(v), -1).astype(float) / SIZE for v in values])
            found += [
                (region.place(points), float(logit))
                for (_, region), points, logit in zip(part, meshes, logits.flat, strict=True)
            ]
        return found

    def _points(self, values: list[np.ndarray]) -> np.ndarray:
        """Points (R, 478, 3) in shares of the region, from the network's six results."""
        mesh, *finer = values
        points = np.empty((len(mesh), LANDMARKS, 3))
        points[:, :MESH] = mesh.reshape(-1, MESH, 3)
        irises = [range(MESH, MESH + IRIS), range(MESH + IRIS, LANDMARKS)]
        for places, flat in zip([*self._refined, *irises], finer, strict=True):
            points[:, list(places), :2] = flat.reshape(len(flat), -1, 2)
        for places, eye in zip(irises, self._refined[1:], strict=True):
            points[:, list(places), 2] = points[:, eye[:RIM], 2].mean(1, keepdims=True)
        return points
