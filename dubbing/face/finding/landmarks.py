"""Face landmarks by FaceMesh, in tracking and in static mode.

P = 478 points in pixels: (column, row, depth), depth in the scale of the columns, smaller nearer.
The two modes make different errors: their mean jitters less, and where they disagree something
covers the face.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubbing.face.finding.face_finder import FaceFinder
from dubbing.face.finding.regions import Images
from dubbing.face.mesh_points import LANDMARKS

MOST_FACES = 4
FAR_OFF = 0.25  # face widths: modes that differ by more look at different faces
# The networks count from the edge of the first pixel, we from its middle.
HALF = np.array([0.5, 0.5, 0.0])


class FaceMesh:
    """FaceMesh; ``tracking`` follows faces from frame to frame."""

    def __init__(self, *, tracking: bool, faces: int = 1) -> None:
        self._finder = FaceFinder(faces)
        self._tracking = tracking

    def restart(self) -> None:
        """Forget the face that was tracked: for the first frame after a cut."""
        self._finder.follow_on([])

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """Faces of an RGB frame: (478, 3) float64 each; an empty list where there is none."""
        if self._tracking:
            return [face - HALF for face in self._finder.follow(image)]
        return self.find([image])[0]

    def find(self, images: Images, *, any_way: bool = False) -> list[list[np.ndarray]]:
        """Faces of each of some frames in static mode; faster than one by one.

        Args:
            any_way: heads may hang upside down.
        """
        found = self._finder.find(images, any_way=any_way)
        return [[face - HALF for face in faces] for faces in found]


def nearest(faces: Sequence[np.ndarray], expected: np.ndarray) -> np.ndarray | None:
    """The face whose middle is nearest to a point (2,); None without a face."""
    distances = [float(np.hypot(*(face[:, :2].mean(0) - expected))) for face in faces]
    return faces[int(np.argmin(distances))] if distances else None


def combine(
    steady: np.ndarray | None, fresh: np.ndarray | None, expected: np.ndarray
) -> tuple[np.ndarray, float, bool]:
    """One face from those of tracking mode and of static mode.

    Args:
        expected: (2,) px, where it should be.

    Returns:
        Points (478, 3), zero without a face; the distance of the modes in px, 0 where only one
        detected the face; whether there is a face.
    """
    if fresh is None or steady is None:
        only = steady if fresh is None else fresh
        if only is None:
            return np.zeros((LANDMARKS, 3)), 0.0, False
        return only, 0.0, near(only, expected)
    apart = float(np.linalg.norm((steady - fresh)[:, :2], axis=1).mean())
    if apart > FAR_OFF * face_width(fresh):
        return fresh, 0.0, near(fresh, expected)
    both = (steady + fresh) / 2
    return both, apart, near(both, expected)


def face_width(points: np.ndarray) -> float:
    """Larger side in px of the box around points (P, 2 or 3)."""
    return float(np.ptp(points[:, :2], axis=0).max())


def near(points: np.ndarray, expected: np.ndarray) -> bool:
    """Whether a face's middle lies within one face width of the expected point (2,)."""
    return bool(np.hypot(*(points[:, :2].mean(0) - expected)) < face_width(points))
