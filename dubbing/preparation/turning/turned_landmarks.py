"""Landmarks of turned heads: where the pose shows them, moved as the lips were seen to move.

FaceMesh distorts a face that is turned far, always in the same way, and sees its lips move
nevertheless. T frames, N of them frontal, K of them turned.
"""

import numpy as np

from dubbing.face.mouth.mouth_shape import LIPS
from dubbing.preparation.alignment.bundle import Observations
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.turning.profile_lips import aligned
from dubbing.preparation.turning.turned import FRONTAL, angles

BLENDED = np.radians(28.0)  # turn from which on detected landmarks do not count at all
FRAMES_A_TERM = 25  # least number of frames for each term of a regression
OUTER = (0, 39, 269), (17, 181, 405)  # rims of the upper and of the lower lip, in the middle
LEAST_SPREAD = 0.005  # of the height of lips, head units: less says nothing of a face


def filled_landmarks(
    detected: dict[str, np.ndarray],
    trusted: np.ndarray,
    shape: np.ndarray,
    poses: Poses,
    observed: Observations,
    changes: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks (T, 478, 2), and the shift (T, 40, 2) from their lips to where speech had them, px.

    As detected, where they can be trusted. Elsewhere the mean shape as it is seen from the pose of
    the head, which changes as what was detected does, or by `changes` (T, 478, 3) where these are
    numbers. What is usual from a side, and is taken from that, holds what is said meanwhile, too.
    So speech had lips where the outer ones are as high as they were detected.
    """
    shapes = np.tile(shape, (len(trusted), 1, 1))
    told = np.zeros(len(trusted), bool)
    if changes is not None:
        told = np.isfinite(changes).all((1, 2))
        shapes[told] += changes[told]
    turned = np.flatnonzero(detected["valid"] & ~trusted & ~told)
    spoken = shapes.copy()
    if len(turned):
        points = detected["points"][turned]
        before, now = (aligned(some, shape) for some in (detected["points"][trusted], points))
        found = shape + undistorted(now, poses.rotation[turned])
        shapes[turned] = found
        high = np.linalg.norm(outer_lips(points[..., :2]), axis=1)
        higher = _missing(found, high, poses[turned], observed.focal, observed.centre[turned])
        found[:, LIPS] += higher[:, None, None] * _change(before)
        spoken[turned] = found
    # From one kind of frame to the other without a jump.
    share = np.clip((BLENDED - angles(poses)) / (BLENDED - FRONTAL), 0, 1)
    share = np.where(trusted, 1, share * detected["valid"])[:, None, None]

    def seen(some: np.ndarray) -> np.ndarray:
        projected = project(to_camera(poses, some), observed.focal, observed.centre)
        return np.asarray(projected + share * (detected["points"][..., :2] - projected))

    landmarks = seen(shapes)
    return landmarks, (seen(spoken) - landmarks)[:, LIPS]


def undistorted(shapes: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """How shapes (K, P, 3) differ from what is usual for the side from which they are seen."""
    side = rotation[:, 2, :2]  # of the head, that the camera sees
    terms = np.column_stack([np.ones(len(side)), side, side**2])
    terms = terms[:, : 1 + len(terms) // FRAMES_A_TERM]
    usual = terms @ np.linalg.lstsq(terms, shapes.reshape(len(shapes), -1), rcond=None)[0]
    return shapes - usual.reshape(shapes.shape)


def outer_lips(points: np.ndarray) -> np.ndarray:
    """From the upper to the lower rim of the lips (K, D), mean of three places, of (K, 478, D)."""
    upper, lower = OUTER
    return np.asarray((points[:, lower] - points[:, upper]).mean(1))


def _change(shapes: np.ndarray) -> np.ndarray:
    """How lips (40, 3) change as they get higher by 1, of shapes (N, 478, 3)."""
    high = outer_lips(shapes)[:, 1]
    high = high - high.mean()
    changes = np.tensordot(high, shapes[:, LIPS], 1)
    return np.asarray(changes / max(high @ high, len(high) * LEAST_SPREAD**2))


def _missing(
    shapes: np.ndarray, high: np.ndarray, poses: Poses, focal: float, centre: np.ndarray
) -> np.ndarray:
    """By how much outer lips (K,) have to be higher to be seen `high` (K,) px high, head units."""
    down = np.zeros_like(shapes)
    down[:, list(OUTER[1]), 1] = 1
    now, then = (
        outer_lips(project(to_camera(poses, some), focal, centre))
        for some in (shapes, shapes + down)
    )
    unit = np.linalg.norm(then - now, axis=1)
    return np.asarray((high - ((then - now) * now).sum(1) / unit) / unit)
