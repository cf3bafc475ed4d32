"""Finds faces in images, and follows them from frame to frame.

A face is detected, and its landmarks are found in the region round it. While it is followed, its
landmarks give the region for the next frame; the detector works only while fewer faces are followed
than are wanted. There is no smoothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dubbing.face.finding.box_detector import FACES, BoxDetector
from dubbing.face.finding.graph_network import network
from dubbing.face.finding.landmark_network import LEAST, LandmarkNetwork
from dubbing.face.finding.regions import MARGIN, TILTED, Images, Region, overlap, tilt
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.face.weight_paths import FACE_DETECTOR, FACE_LANDMARKS

CONFIDENCE = 0.5  # a detected face's least score
# Of a face that is seen the right way the odds have a logarithm of 20 to 31, of one upside down of
# -2 to 17: four people, turned by 0 to 210 degrees.
SURE = 20.0
AGAIN = 2  # times that a tilted face is looked at again
SAME_FACE = 0.5  # intersection over union of regions


class FaceFinder:
    """Landmarks (478, 3) of faces: column, row and depth in px from the edge of the first one.

    Args:
        faces: how many may be found in an image.
    """

    def __init__(self, faces: int = 1) -> None:
        self._detector = BoxDetector(network(FACE_DETECTOR), FACES, CONFIDENCE)
        self._landmarks = LandmarkNetwork(network(FACE_LANDMARKS))
        self._faces = faces
        self._followed: list[Region] = []

    def follow_on(self, regions: Sequence[Region]) -> None:
        """Follow the faces of these regions, in the place of those before."""
        self._followed = [*regions]

    def find(self, images: Images, *, any_way: bool = False) -> list[list[np.ndarray]]:
        """Faces of images that need not follow one another.

        The box of a tilted face is detected roughly: it is looked at again where its points lie.

        Args:
            any_way: heads may hang upside down, in which the detector sees faces that stand.
        """
        regions = [distinct(some) for some in self.detect(images)]
        found = []
        for image, some in zip(images, self._look_doubting(images, regions), strict=True):
            faces = [
                self._turned(image, points) if any_way and sure < SURE else points
                for points, sure in some
            ]
            for _ in range(AGAIN):
                for k, region in enumerate(map(region_of, faces)):
                    if abs(region.rotation) > np.radians(TILTED[0]):
                        (again,) = self._look([image], [[region]])
                        faces[k : k + 1] = again or faces[k : k + 1]
            found.append(faces)
        return found

    def _turned(self, image: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The face that has its chin where points of an unsure one have a forehead; else these."""
        region = region_of(points)
        region = replace(region, rotation=region.rotation + np.pi)
        for _ in range(1 + AGAIN):
            ((turned, sure),) = self._landmarks.doubted([(image, region)])
            region = region_of(turned)
        return turned if sure > SURE else points

    def detect(self, images: Images) -> list[list[Region]]:
        """Regions of faces of images, in which `follow` looks beside those that it follows."""
        boxes = self._detector(images, self._faces)
        return [[_detected(*box) for box in some] for some in boxes]

    def follow(
        self, image: np.ndarray, detected: Sequence[Region] | None = None
    ) -> list[np.ndarray]:
        """Faces of the next frame, where `detected` may be what `detect` gave for it."""
        if detected is None or len(self._followed) >= self._faces:
            (faces,) = self.follow_all([image], [self._followed])
        else:
            (faces,) = self._look([image], [distinct([*detected, *self._followed])])
        self._followed = [region_of(points) for points in faces]
        return faces

    def follow_all(
        self, images: Images, followed: Sequence[Sequence[Region]]
    ) -> list[list[np.ndarray]]:
        """Faces of one frame of each of several videos, where some regions are followed."""
        lost = [k for k, regions in enumerate(followed) if len(regions) < self._faces]
        detected = self.detect([images[k] for k in lost])
        regions = [list(some) for some in followed]
        for k, some in zip(lost, detected, strict=True):
            regions[k] = [*some, *regions[k]]
        return self._look(images, [distinct(some) for some in regions])

    def _look(self, images: Images, regions: Sequence[Sequence[Region]]) -> list[list[np.ndarray]]:
        """Faces in some regions of each image."""
        return [[points for points, _ in some] for some in self._look_doubting(images, regions)]

    def _look_doubting(
        self, images: Images, regions: Sequence[Sequence[Region]]
    ) -> list[list[tuple[np.ndarray, float]]]:
        """The same with how sure they are, see `LandmarkNetwork.doubted`."""
        looks = [(image, r) for image, some in zip(images, regions, strict=True) for r in some]
        faces = iter(self._landmarks.doubted(looks))
        return [[f for f in (next(faces) for _ in some) if f[1] > LEAST] for some in regions]


def distinct(regions: Sequence[Region]) -> list[Region]:
    """Regions without those that a later one covers: that one is the same face."""
    kept: list[Region] = []
    for region in regions:
        kept = [other for other in kept if overlap(region, other) <= SAME_FACE]
        kept.append(region)
    return kept


def region_of(points: np.ndarray) -> Region:
    """The region in which a face with these points (478, 3) is looked for in the next frame."""
    flat = points[:, :2]
    return Region.around(flat, flat[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER]])


def _detected(low: np.ndarray, high: np.ndarray, *eyes: np.ndarray) -> Region:
    """The region of a detected box; see `BoxDetector`."""
    column, row = (low + high) / 2
    side = MARGIN * float((high - low).max())
    return Region(float(column), float(row), side, tilt(np.stack(eyes)))
