"""The pinhole camera of the crop, head poses, and derivatives of pixels by head motion.

T frames, P points. Pixel coordinates are OpenCV's: (column, row), (0, 0) the middle of the first
pixel. Camera axes: x right, y down, z forward. Poses map the head frame into the camera:
X_cam = R X + t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

# The focal length hardly matters for a head that fills the frame, but a wrong perspective distorts
# the turns of one that moves far. A head that fills the frame is filmed from about .8 m: 2.34 crop
# widths. A frame that shows more is filmed from further away: with a normal lens, 50 mm on 36 mm.
NEAR_LENS = 2.34  # crop widths
NORMAL_LENS = 50 / 36  # longer sides of the frame


def rotation_from_vector(vector: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, 3) in radians to matrices (T, 3, 3)."""
    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def vector_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Rotation matrices (T, 3, 3) to rotation vectors (T, 3) in radians."""
    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())


def relative_vectors(rotation: np.ndarray) -> np.ndarray:
    """Turn from each frame to the next, log(R_{t+1} R_t^T): (T, 3, 3) to (T - 1, 3), radians."""
    return vector_from_rotation(rotation[1:] @ rotation[:-1].transpose(0, 2, 1))


@dataclass(frozen=True)
class Poses:
    """Head poses: rotation (T, 3, 3) and translation (T, 3), in units of about 10 cm."""

    rotation: np.ndarray
    translation: np.ndarray

    def __len__(self) -> int:
        return len(self.rotation)

    def __getitem__(self, index: np.ndarray | slice) -> Poses:
        return Poses(self.rotation[index], self.translation[index])

    def stepped(self, step: np.ndarray) -> Poses:
        """Poses after a step (T, 6): a turn on the left of R (radians) and a shift of t."""
        turn = rotation_from_vector(step[:, :3])
        return Poses(turn @ self.rotation, self.translation + step[:, 3:])


def focal_length(window: np.ndarray, source_size: tuple[int, int], size: int) -> float:
    """Focal length of a crop, px.

    Args:
        window: (T, 4) windows of the crop, all of one side, see `cropping`.
        source_size: width and height of the source, px.
        size: side of the crop, px.
    """
    frame = max(source_size) * size / float(window[0, 2])
    return max(NEAR_LENS * size, NORMAL_LENS * frame)


def to_camera(poses: Poses, points: np.ndarray) -> np.ndarray:
    """Points (P, 3) of the head frame in every camera: (T, P, 3)."""
    turned = points @ poses.rotation.transpose(0, 2, 1)
    turned += poses.translation[:, None]
    return np.asarray(turned)


def project(in_camera: np.ndarray, focal: float, centre: np.ndarray) -> np.ndarray:
    """Pixels (T, P, 2) of points (T, P, 3) in the camera; centre (T, 2) is the principal point."""
    return focal * in_camera[..., :2] / in_camera[..., 2:] + centre[:, None]


def point_jacobian(in_camera: np.ndarray, focal: float) -> np.ndarray:
    """Derivative of the pixel by the point in the camera: (..., 3) to (..., 2, 3)."""
    x, y, z = in_camera[..., 0], in_camera[..., 1], in_camera[..., 2]
    out = np.zeros((*in_camera.shape[:-1], 2, 3))
    out[..., 0, 0] = out[..., 1, 1] = focal / z
    out[..., 0, 2] = -focal * x / z**2
    out[..., 1, 2] = -focal * y / z**2
    return out


def pose_jacobian(in_camera: np.ndarray, translation: np.ndarray, focal: float) -> np.ndarray:
    """Derivative of the pixel by the step of :meth:`Poses.stepped`: (T, P, 2, 6).

    A left turn by w moves R X by w x (R X); a . (w x R X) = w . (R X x a).
    """
    by_point = point_jacobian(in_camera, focal)
    turned = in_camera - translation[:, None]
    return np.concatenate((np.cross(turned[..., None, :], by_point), by_point), axis=-1)
