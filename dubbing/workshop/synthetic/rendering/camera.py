"""The camera and the conversions between the package's axes and OpenCV's.

Truth is written in OpenCV axes (x right, y down, z away) in units of 10 cm. Inside, points are
centimetres with y up and z towards the viewer. Pixel (column, row) has its centre at whole numbers.
"""

from dataclasses import dataclass

import numpy as np

FLIP = np.diag([1.0, -1.0, -1.0])
UNIT = 10.0  # cm in one unit of the truth
DISTANCE = 78.0  # cm from the camera to the head's origin
FOCAL_512 = 980.0  # px for an image of 512 px


@dataclass(frozen=True)
class Camera:
    """A pinhole camera of a square image; `zoom` enlarges what it sees."""

    size: int
    zoom: float = 1.0

    @property
    def focal(self) -> float:
        return FOCAL_512 * self.size / 512.0 * self.zoom

    @property
    def centre(self) -> float:
        """Principal point, column and row alike."""
        return (self.size - 1) / 2.0

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Unit directions (N, 3) in camera axes (y up, z to the viewer) through pixels (N,)."""
        x = (columns - self.centre) / self.focal
        y = (self.centre - rows) / self.focal
        d = np.stack([x, y, -np.ones_like(x)], axis=-1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (N, 2: column, row) of points (N, 3) in camera axes (y up), centimetres."""
        return np.stack(
            [
                self.centre + self.focal * points[:, 0] / -points[:, 2],
                self.centre - self.focal * points[:, 1] / -points[:, 2],
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class Pose:
    """Head pose in OpenCV axes: X_cam = rotation X + translation, units of 10 cm."""

    rotation: np.ndarray
    translation: np.ndarray

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) rotation from head to camera in the axes used inside."""
        return FLIP @ self.rotation @ FLIP

    @property
    def shift(self) -> np.ndarray:
        """(3,) position of the head's origin in camera axes used inside, cm."""
        return UNIT * FLIP @ self.translation

    @property
    def eye(self) -> np.ndarray:
        """(3,) camera centre in the head frame used inside, cm."""
        return -self.turn.T @ self.shift
