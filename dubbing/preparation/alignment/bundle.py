"""Head poses, and points of the head, from landmarks: Gauss-Newton.

T frames, P points, 6 unknowns a frame. Minimised (Triggs et al. 2000, with Huber's loss):

    sum_tp rho(|pi(R_t X_p + T_t) - u_tp| / sigma_p)
    + sum_t |d2 omega_t|^2 / (.5 deg)^2 + sum_t |d2 T_t|^2 / (.01, .01, .06)^2

over the poses, whose matrix is banded. `triangulate` solves for the points instead, with the prior
|X_p - X0_p|^2 / .05^2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from dubbing.preparation.alignment.banded import (
    DOF,
    NormalEquations,
    huber_weight,
    lower_band,
    smoothness_blocks,
    solve_band,
)
from dubbing.preparation.alignment.camera import (
    Poses,
    point_jacobian,
    pose_jacobian,
    project,
    relative_vectors,
    to_camera,
)
from dubbing.preparation.alignment.silhouette import Silhouette

SHAPE_SIGMA = 0.05
TURN_SIGMA = np.deg2rad(0.5)  # of second differences at 25 frames a second
SHIFT_SIGMA = np.array([0.01, 0.01, 0.06])
REFERENCE_RATE = 25.0
DAMPING = 1e-6  # keeps frames without a face solvable: their poses stay
SHAPE_FRAMES = 250
POSE_STEPS = 8
POINT_STEPS = 3  # of Gauss-Newton, for points from known poses
LEAST_SIGMA = 0.25  # px


@dataclass(frozen=True)
class Observations:
    """Observations of the rigid points.

    pixels (T, P, 2), confidence (T,) in 0..1: 0 where the face is hidden, linked (T,) bool:
    smoothness joins the frame with those before and after it, focal px, centre (T, 2) px, rate
    frames a second, silhouette the outline of the head, None where it was not measured.
    """

    pixels: np.ndarray
    confidence: np.ndarray
    linked: np.ndarray
    focal: float
    centre: np.ndarray
    rate: float
    silhouette: Silhouette | None = None

    @property
    def usable(self) -> np.ndarray:
        """Frames (T,) bool that constrain the pose."""
        return np.asarray(self.confidence > 0)

    def spread(self, count: int) -> np.ndarray:
        """Indices of at most so many usable frames, evenly spread over the clip."""
        usable = np.flatnonzero(self.usable)
        return usable[np.unique(np.linspace(0, len(usable) - 1, count).round().astype(int))]

    def take(self, index: np.ndarray) -> Observations:
        """Some of the frames, with no smoothness between them."""
        return replace(
            self,
            pixels=self.pixels[index],
            confidence=self.confidence[index],
            linked=np.zeros(len(index), bool),
            centre=self.centre[index],
            silhouette=None if self.silhouette is None else self.silhouette.take(index),
        )


def start_poses(shape: np.ndarray, observed: Observations) -> Poses:
    """Perspective-n-point pose of every usable frame; the others copy the nearest usable one."""
    frames = len(observed.pixels)
    rotation, translation = np.zeros((frames, 3, 3)), np.zeros((frames, 3))
    usable = np.flatnonzero(observed.usable)
    for t in usable:
        camera = np.array(
            [
                [observed.focal, 0, observed.centre[t, 0]],
                [0, observed.focal, observed.centre[t, 1]],
                [0, 0, 1],
            ]
        )
        _, vector, shift = cv2.solvePnP(
            shape, observed.pixels[t].astype(np.float64), camera, None, flags=cv2.SOLVEPNP_SQPNP
        )
        rotation[t], translation[t] = cv2.Rodrigues(vector)[0], shift[:, 0]
    nearest = usable[np.abs(np.arange(frames)[:, None] - usable[None]).argmin(1)]
    return Poses(rotation[nearest], translation[nearest])


def smoothness_weights(rate: float, slack: float) -> np.ndarray:
    """Inverse variances (6,) of the second differences; these shrink with the rate's square.

    Args:
        slack: factor of the standard deviations.
    """
    sigma = slack * np.concatenate((np.full(3, TURN_SIGMA), SHIFT_SIGMA))
    sigma *= (REFERENCE_RATE / rate) ** 2
    return np.asarray(1.0 / sigma**2)


def landmark_weights(residual: np.ndarray, sigma: np.ndarray, confidence: np.ndarray) -> np.ndarray:
    """Weight (T, P) of every observation: Huber's over the point's variance, by confidence."""
    distance = np.linalg.norm(residual, axis=-1)
    return np.asarray(huber_weight(distance / sigma) / sigma**2 * confidence[:, None])


def landmark_equations(
    poses: Poses, shape: np.ndarray, observed: Observations, sigma: np.ndarray
) -> NormalEquations:
    """Landmark part of a pose step."""
    in_camera = to_camera(poses, shape)
    residual = project(in_camera, observed.focal, observed.centre) - observed.pixels
    weight = landmark_weights(residual, sigma, observed.confidence)
    jacobian = pose_jacobian(in_camera, poses.translation, observed.focal)
    weighted = jacobian * weight[..., None, None]
    frames = len(poses)
    flat, flat_weighted = jacobian.reshape(frames, -1, DOF), weighted.reshape(frames, -1, DOF)
    return NormalEquations(
        flat_weighted.transpose(0, 2, 1) @ flat,
        -np.einsum("tkd,tk->td", flat_weighted, residual.reshape(frames, -1)),
    )


def smoothness_right(poses: Poses, linked: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Right-hand side (T, 6) of the smoothness at the present poses."""
    right = np.zeros((len(poses), DOF))
    middle = np.flatnonzero(linked)
    if len(middle) == 0:
        return right
    turns = relative_vectors(poses.rotation)
    shifts = np.diff(poses.translation, axis=0)
    velocity = np.concatenate((turns, shifts), axis=1)
    bend = (velocity[middle] - velocity[middle - 1]) * weight
    for shift, factor in ((-1, 1.0), (0, -2.0), (1, 1.0)):
        np.add.at(right, middle + shift, -factor * bend)
    return right


def smoothed_system(
    poses: Poses, equations: NormalEquations, observed: Observations, slack: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Band matrix and right-hand side (6 T,) of a step of all poses, smoothness included."""
    weight = smoothness_weights(observed.rate, slack)
    one, off1, off2 = smoothness_blocks(observed.linked, weight)
    diagonal = equations.diagonal + one + DAMPING * np.eye(DOF) * weight
    right = equations.right + smoothness_right(poses, observed.linked, weight)
    return lower_band(diagonal, off1, off2), right.ravel()


def point_sigmas(poses: Poses, shape: np.ndarray, observed: Observations) -> np.ndarray:
    """Spread (P,) in px of every point's residuals: 1.4826 times their median absolute value."""
    residual = project(to_camera(poses, shape), observed.focal, observed.centre) - observed.pixels
    spread = 1.4826 * np.median(np.abs(residual[observed.usable]), axis=(0, 2))
    return np.maximum(spread, LEAST_SIGMA)


def fit_poses(
    shape: np.ndarray, poses: Poses, observed: Observations, steps: int = POSE_STEPS
) -> Poses:
    """Poses of all frames for a known shape (P, 3), smoothed within each shot."""
    for _ in range(steps):
        sigma = point_sigmas(poses, shape, observed)
        equations = landmark_equations(poses, shape, observed, sigma)
        step = solve_band(*smoothed_system(poses, equations, observed))
        poses = poses.stepped(step.reshape(-1, DOF))
    return poses


def triangulate(
    prior: np.ndarray, pixels: np.ndarray, poses: Poses, observed: Observations
) -> np.ndarray:
    """Points (P, 3) that best explain pixels (T, P, 2) from known poses, drawn to a prior."""
    index = observed.spread(SHAPE_FRAMES)
    some = replace(observed.take(index), pixels=pixels[index])
    chosen, points = poses[index], prior
    for _ in range(POINT_STEPS):
        in_camera = to_camera(chosen, points)
        residual = project(in_camera, some.focal, some.centre) - some.pixels
        sigma = point_sigmas(chosen, points, some)
        weight = landmark_weights(residual, sigma, some.confidence)
        jacobian = point_jacobian(in_camera, some.focal) @ chosen.rotation[:, None]
        weighted = jacobian * weight[..., None, None]
        own = np.einsum("tpki,tpkj->pij", weighted, jacobian) + np.eye(3) / SHAPE_SIGMA**2
        right = -np.einsum("tpkj,tpk->pj", weighted, residual) - (points - prior) / SHAPE_SIGMA**2
        points = points + np.linalg.solve(own, right[..., None])[..., 0]
    return points
