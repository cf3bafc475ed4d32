"""Face landmarks by FaceMesh, in tracking and in static mode.

P = 478 points in pixels: (column, row, depth), depth in the scale of the columns, smaller nearer.
The two modes make different errors: their mean jitters less, and where they disagree something
covers the face.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dubbing.face.face_finder import CONFIDENCE, FaceFinder
from dubbing.face.mesh_points import LANDMARKS

MOST_FACES = 4
FAR_OFF = 0.25  # face widths: modes that differ by more look at different faces
# The networks count from the edge of the first pixel, we from its middle.
HALF = np.array([0.5, 0.5, 0.0])


class FaceMesh:
    """FaceMesh; ``tracking`` follows faces from frame to frame."""

    def __init__(self, *, tracking: bool, faces: int = 1, confidence: float = CONFIDENCE) -> None:
        self._finder = FaceFinder(faces, confidence)
        self._tracking = tracking

    def restart(self) -> None:
        """Forget the face that was tracked: for the first frame after a cut."""
        self._finder.restart()

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """Faces of an RGB frame: (478, 3) float64 each; an empty list where there is none."""
        if self._tracking:
            return [face - HALF for face in self._finder.follow(image)]
        return self.find([image])[0]

    def find(self, images: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
        """Faces of each of some frames in static mode; faster than one by one."""
        return [[face - HALF for face in faces] for faces in self._finder.find(images)]


class TwoModes:
    """Tracking and static FaceMesh side by side on the frames of one clip.

    Args:
        faces: how many the static one may detect.
    """

    def __init__(self, faces: int) -> None:
        self._tracking = FaceMesh(tracking=True)
        self._static = FaceMesh(tracking=False, faces=faces)

    def __call__(
        self, images: Sequence[np.ndarray], expected: np.ndarray, starts: np.ndarray
    ) -> list[tuple[np.ndarray, float, bool]]:
        """Landmarks of the face nearest to ``expected`` (B, 2) px in each of B frames in a row.

        Args:
            starts: (B,), whether a frame is the first one of a shot.

        Returns:
            Of each frame: points (478, 3), zero without a face; the distance of the modes in px, 0
            where only one detected the face; whether there is a face.
        """
        found = []
        for image, fresh, place, start in zip(
            images, self._static.find(images), expected, starts, strict=True
        ):
            if start:
                self._tracking.restart()
            found.append(combine(self._tracking(image), fresh, place))
        return found


def combine(
    steady: list[np.ndarray], fresh: list[np.ndarray], expected: np.ndarray
) -> tuple[np.ndarray, float, bool]:
    """One face from those of tracking and of static mode; see :class:`TwoModes`."""
    candidates = sorted(fresh, key=lambda f: float(np.hypot(*(f[:, :2].mean(0) - expected))))
    if not candidates and not steady:
        return np.zeros((LANDMARKS, 3)), 0.0, False
    if not candidates or not steady:
        only = candidates[0] if candidates else steady[0]
        return only, 0.0, near(only, expected)
    apart = float(np.linalg.norm(steady[0][:, :2] - candidates[0][:, :2], axis=1).mean())
    if apart > FAR_OFF * face_width(candidates[0]):
        return candidates[0], 0.0, near(candidates[0], expected)
    both = (steady[0] + candidates[0]) / 2
    return both, apart, near(both, expected)


def face_width(points: np.ndarray) -> float:
    """Larger side in px of the box around points (P, 2 or 3)."""
    return float(np.ptp(points[:, :2], axis=0).max())


def near(points: np.ndarray, expected: np.ndarray) -> bool:
    """Whether a face's middle lies within one face width of the expected point (2,)."""
    return bool(np.hypot(*(points[:, :2].mean(0) - expected)) < face_width(points))
