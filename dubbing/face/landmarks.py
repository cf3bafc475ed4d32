"""Face landmarks by MediaPipe FaceMesh, in tracking and in static mode.

P = 478 points in pixels: (column, row, depth), depth in the scale of the columns, smaller nearer.
The two modes make different errors: their mean jitters less, and where they disagree something
covers the face.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from dubbing.face.mediapipe_graph import Solution, solution
from dubbing.face.mesh_points import LANDMARKS

MOST_FACES = 4
CONFIDENCE = 0.5
FAR_OFF = 0.25  # face widths: modes that differ by more look at different faces


class FaceMesh:
    """FaceMesh as a context manager; ``tracking`` follows one face from frame to frame."""

    def __init__(self, *, tracking: bool, faces: int = 1, confidence: float = CONFIDENCE) -> None:
        self._settings = {
            "static_image_mode": not tracking,
            "max_num_faces": faces,
            "refine_landmarks": True,
            "min_detection_confidence": confidence,
        }
        self._mesh: Solution | None = None

    def __enter__(self) -> FaceMesh:
        self.restart()
        return self

    def __exit__(self, *_: object) -> None:
        if self._mesh is not None:
            self._mesh.close()
            self._mesh = None

    def restart(self) -> None:
        """Forget the face that was tracked: for the first frame after a cut."""
        if self._mesh is not None:
            self._mesh.close()
        self._mesh = Solution(partial(solution("face_mesh").FaceMesh, **self._settings))

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """Faces of an RGB frame: (478, 3) float64 each; an empty list where there is none."""
        height, width = image.shape[:2]
        assert self._mesh is not None  # inside of `with` only
        faces = self._mesh.process(image).multi_face_landmarks or []
        # MediaPipe counts from the edge of the first pixel, we from its middle.
        scale, half = np.array([width, height, width]), np.array([0.5, 0.5, 0.0])
        return [np.array([(p.x, p.y, p.z) for p in face.landmark]) * scale - half for face in faces]


class TwoModes:
    """Tracking and static FaceMesh side by side on the frames of one clip."""

    def __init__(self, tracking: FaceMesh, static: FaceMesh) -> None:
        self._tracking, self._static = tracking, static

    def restart(self) -> None:
        """Forget the face that was tracked: for the first frame of a shot."""
        self._tracking.restart()

    def __call__(self, image: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, float, bool]:
        """Landmarks of the face nearest to ``expected`` (2,) px.

        Returns:
            Points (478, 3), zero without a face; the distance of the modes in px, 0 where only one
            detected the face; whether there is a face.
        """
        steady, fresh = self._tracking(image), self._static(image)
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


@contextmanager
def two_modes(faces: int) -> Iterator[TwoModes]:
    """Both modes, as a context; ``faces``: how many the static one may detect."""
    with (
        FaceMesh(tracking=True) as tracking,
        FaceMesh(tracking=False, faces=faces) as static,
    ):
        yield TwoModes(tracking, static)
