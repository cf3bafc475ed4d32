"""Photometric refinement: direct alignment of the upper face in all frames together.

T frames, K of them, N points of the skin, C unknowns that a grey value depends on. Landmark jitter
is shared by all points of a frame, so no bundle adjustment removes it; the pixels do. Every frame
is aligned to the mean face texture by Gauss-Newton on the pose (Lucas and Kanade 1981, with
J = grad I . d pi / d(omega, T) of the mean), together with the landmark and smoothness terms of
:mod:`bundle`.
Gain and offset of a frame are eliminated: residuals and Jacobian are taken orthogonal to a constant
and to the texture.
"""

from __future__ import annotations

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import EYE_CORNERS
from dubbing.preparation.alignment import silhouette
from dubbing.preparation.alignment.banded import DOF, NormalEquations, huber_weight, solve_band
from dubbing.preparation.alignment.bundle import (
    Observations,
    landmark_equations,
    point_sigmas,
    smoothed_system,
)
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.alignment.photometric import Alignment, View, dot, in_chunks
from dubbing.preparation.alignment.texture import Texture

STEPS = 8  # of Gauss-Newton, at most
REST = 0.02  # px rms: a step that moves landmarks by less ends the iteration
CORRELATED = 8.0  # errors of neighbouring pixels are correlated: so many count as one
LANDMARK_INFLATION = 60.0  # of the landmarks' variances; they only fix what pixels leave free
SLACK = 4.0  # of the smoothness of poses: that for landmarks would damp nods seen in the pixels
LEAST_POINTS = 50  # visible in a frame
LEAST_GAIN = 0.1  # contrast of a frame to that of the mean; below, it shows something else


def without_gain(
    columns: np.ndarray, texture: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (K, N, C) without their parts along 1 and along the texture (N,).

    Args:
        weight: (K, N).

    Returns:
        The columns (K, N, C) and the coefficients (K, 2, C) of the parts removed.
    """
    basis = np.stack((np.ones_like(texture), texture), axis=1).astype(columns.dtype)
    weighted = (basis * weight[..., None].astype(columns.dtype)).transpose(0, 2, 1)
    coefficients = np.linalg.solve(weighted @ basis, weighted @ columns)
    return columns - basis @ coefficients, coefficients


def jacobian_of(
    view: View, texture: Texture, relief: tuple[np.ndarray, np.ndarray] | None
) -> np.ndarray:
    """Derivatives (K, N, C) of the grey values by the pose's step, and by the relief's bumps.

    They are 0 of points that are not visible: one that is seen edge-on has none.
    """
    slope = np.where(view.visible[..., None], texture.slope.astype(np.float32) @ view.turns, 0)
    facing = np.where(view.visible, dot(view.normals, view.in_camera), 1)
    # Motion along the ray changes nothing: the slope's part along the ray is replaced by one along
    # the normal.
    along = dot(slope, view.in_camera) / facing
    slope -= along[..., None] * view.normals
    # A left turn by w moves R X by w x (R X).
    columns = [np.cross(view.points, slope), slope]
    if relief is not None:
        rays, basis = relief
        moved = dot(rays.astype(np.float32) @ view.turns, slope)
        columns.append(moved[..., None] * basis.astype(np.float32))
    return np.concatenate(columns, axis=2)


def pixel_equations(
    poses: Poses,
    observed: Observations,
    work: Alignment,
    texture: Texture,
    relief: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Normal equations of a step from the pixels: matrices (T, C, C) and right-hand sides (T, C).

    Residuals are in the texture's contrast. Frames that are not usable give zeros.

    Args:
        relief: directions (N, 3) of the head frame in which the points may move, and a basis
            (N, B) of how far; B unknowns follow the six of the pose.
    """

    def of_some(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        view = work.view(poses, frames)
        values = work.values(frames, view)
        weight = np.where(np.isfinite(values), texture.weight, 0).astype(np.float32)
        known = (weight > 0).sum(1) >= LEAST_POINTS
        weight[~known] = texture.weight  # keeps the system solvable; these frames get weight 0
        jacobian = jacobian_of(view, texture, relief)
        columns = np.concatenate((jacobian, np.nan_to_num(values)[..., None]), axis=2)
        clean, fit = without_gain(columns, texture.mean, weight)
        # values = offset + gain * texture + residual: compare in the texture's contrast.
        gain = fit[:, 1, -1]
        known &= gain >= LEAST_GAIN
        clean[..., -1] /= np.where(known, gain, 1)[:, None]
        far = np.abs(clean[..., -1]) * np.sqrt(weight)
        robust = huber_weight(far) * weight / CORRELATED * known[:, None]
        weighted = (clean[..., :-1] * robust[..., None]).transpose(0, 2, 1)
        both = product(weighted, clean)
        return both[..., :-1].astype(np.float64), -both[..., -1].astype(np.float64)

    usable = np.flatnonzero(observed.usable)
    unknowns = DOF + (0 if relief is None else relief[1].shape[1])
    matrix, right = np.zeros((len(poses), unknowns, unknowns)), np.zeros((len(poses), unknowns))
    parts = list(in_chunks(of_some, usable))
    matrix[usable], right[usable] = (np.concatenate(p) for p in zip(*parts, strict=True))
    return matrix, right


def product(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """one @ other, (K, C, N) and (K, N, D), a few points at a time.

    BLAS starts threads for products of 2^18 multiplications; below ours they mostly wait.
    """
    few = max(1, 2**18 // (one.shape[1] * other.shape[2]) - 1)
    parts = range(0, one.shape[2], few)
    return np.asarray(sum(one[:, :, p : p + few] @ other[:, p : p + few] for p in parts))


def refine(
    poses: Poses,
    work: Alignment,
    texture: Texture,
    shape: np.ndarray,
    observed: Observations,
    progress: ReportShare,
) -> Poses:
    """Poses that align the skin's pixels with a texture, from a start within a few px.

    Args:
        shape: (P, 3) rigid landmarks, of which ``observed`` has the pixels.
    """
    for done in range(STEPS):
        rest = beside_pixels(poses, shape, observed)
        matrix, right = pixel_equations(poses, observed, work, texture)
        both = NormalEquations(rest.diagonal + matrix, rest.right + right)
        step = solve_band(*smoothed_system(poses, both, observed, SLACK))
        before, poses = poses, poses.stepped(step.reshape(-1, DOF))
        progress((done + 1) / STEPS)
        old, new = (
            project(to_camera(p, shape), observed.focal, observed.centre) for p in (before, poses)
        )
        if np.sqrt(((new - old) ** 2).sum(-1).mean()) < REST:
            break
    return poses


def beside_pixels(poses: Poses, shape: np.ndarray, observed: Observations) -> NormalEquations:
    """Normal equations that fix poses where pixels do not: weak landmarks, and the outline.

    Args:
        shape: (P, 3) rigid landmarks; the last are the corners of the eyes.
    """
    sigma = point_sigmas(poses, shape, observed) * np.sqrt(LANDMARK_INFLATION)
    marks = landmark_equations(poses, shape, observed, sigma)
    if observed.silhouette is None:
        return marks
    corners = shape[-len(EYE_CORNERS) :]
    outline = silhouette.equations(
        observed.silhouette, poses, corners, observed.focal, observed.centre
    )
    return NormalEquations(marks.diagonal + outline.diagonal, marks.right + outline.right)
