"""Photometric refinement: direct alignment of the upper face in all frames together.

T frames, N points of the skin. Landmark jitter is shared by all points of a frame, so no bundle
adjustment removes it; the pixels do. Every frame is aligned to the mean face texture by
Gauss-Newton on the pose (Lucas and Kanade 1981, with J = grad I . d pi / d(omega, T)), together
with the landmark and smoothness terms of :mod:`bundle`. Gain and offset of a frame are eliminated:
residuals and Jacobian are taken orthogonal to a constant and to the texture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dubbing.face.mesh_points import EYE_CORNERS
from dubbing.preparation.alignment import silhouette
from dubbing.preparation.alignment.banded import DOF, NormalEquations, huber_weight, solve_band
from dubbing.preparation.alignment.bundle import (
    Observations,
    landmark_equations,
    point_sigmas,
    smoothed_system,
)
from dubbing.preparation.alignment.camera import (
    Poses,
    point_jacobian,
    pose_jacobian,
    project,
    to_camera,
)
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.skin import Skin
from dubbing.preparation.alignment.threads import in_order

STEPS = 8  # of Gauss-Newton
NOISE = 4.0  # grey levels: of a pixel whose texture does not change at all
CORRELATED = 8.0  # neighbouring pixels err together: so many count as one
LANDMARK_INFLATION = 60.0  # of the landmarks' variances; they only hold what pixels do not see
SLACK = 4.0  # of the smoothness of poses: what landmarks need damps a nod that pixels see
LEAST_FACING = 0.3  # cosine between normal and ray, below which a point is not used
LEAST_POINTS = 50  # seen in a frame
LEAST_GAIN = 0.1  # contrast of a frame to that of the mean; below, it shows something else
SCORE_STEPS = 5
CHUNK = 16  # frames a thread treats at a time


@dataclass(frozen=True)
class Texture:
    """The mean face: grey values (N,) and inverse variances (N,), 0 where never seen."""

    mean: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class Alignment:
    """What photometric refinement works on: the skin, its pictures and the camera."""

    skin: Skin
    strip: FaceStrip
    focal: float
    centre: np.ndarray

    def with_skin(self, skin: Skin) -> Alignment:
        """The same pictures for points elsewhere."""
        return replace(self, skin=skin)

    def take(self, index: np.ndarray) -> Alignment:
        """Some of the frames."""
        return replace(self, strip=self.strip.take(index), centre=self.centre[index])

    def samples(self, poses: Poses, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Grey values (K, N) float32 of the given frames, NaN where not seen, and pixels."""
        chosen = poses[frames]
        in_camera = to_camera(chosen, self.skin.points)
        pixels = project(in_camera, self.focal, self.centre[frames])
        values = np.stack([self.strip.sample(t, at) for t, at in zip(frames, pixels, strict=True)])
        normals = np.einsum("tij,pj->tpi", chosen.rotation, self.skin.normals)
        facing = -(normals * in_camera).sum(-1) / np.linalg.norm(in_camera, axis=-1)
        values[facing < LEAST_FACING] = np.nan
        return values, pixels


def texture_of(values: np.ndarray) -> Texture:
    """Mean face of samples (T, N): temporal median, weight 1 / (MAD^2 + 4^2).

    Frames are first brought to a common mean and contrast.
    """
    mean = np.nanmean(values, axis=1, keepdims=True)
    contrast = np.nanstd(values, axis=1, keepdims=True)
    even = (values - mean) / contrast * np.median(contrast) + np.median(mean)
    seen = np.isfinite(even).mean(0) > 0.5
    even = np.where(seen, even, 0)
    texture = np.nanmedian(even, axis=0)
    spread = np.nanmedian(np.abs(even - texture), axis=0)
    return Texture(texture, np.where(seen, 1 / (spread**2 + NOISE**2), 0))


def without_gain(
    columns: np.ndarray, texture: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Columns (N, C) with their weighted parts along 1 and along the texture (N,) taken out.

    Returns:
        The columns (N, C) and the coefficients (2, C) of what was taken out.
    """
    basis = np.stack((np.ones_like(texture), texture), axis=1)
    weighted = basis * weight[:, None]
    coefficients = np.linalg.solve(weighted.T @ basis, weighted.T @ columns)
    return columns - basis @ coefficients, coefficients


@dataclass(frozen=True)
class FrameEquations:
    """Equations of one frame's pixels: jacobian (n, C), residual (n,), weight (n,) of n points."""

    frame: int
    jacobian: np.ndarray
    residual: np.ndarray
    weight: np.ndarray


def frame_equations(
    poses: Poses,
    seen: Observations,
    work: Alignment,
    texture: Texture,
    relief: tuple[np.ndarray, np.ndarray] | None = None,
) -> Iterator[FrameEquations]:
    """Linearised residuals of every usable frame, in the texture's contrast.

    Args:
        relief: directions (N, 3) of the head frame in which the points may move, and a basis
            (N, K) of how far; their derivatives follow the six of the pose.
    """

    def of_some(index: np.ndarray) -> list[FrameEquations]:
        return list(some_equations(poses, index, work, texture, relief))

    usable = np.flatnonzero(seen.usable)
    parts = ((usable[p : p + CHUNK],) for p in range(0, len(usable), CHUNK))
    for part in in_order(of_some, parts):
        yield from part


def some_equations(
    poses: Poses,
    index: np.ndarray,
    work: Alignment,
    texture: Texture,
    relief: tuple[np.ndarray, np.ndarray] | None,
) -> Iterator[FrameEquations]:
    """:func:`frame_equations` of the frames `index` (K,)."""
    values, pixels = work.samples(poses, index)
    in_camera = to_camera(poses[index], work.skin.points)
    by_pose = pose_jacobian(in_camera, poses.translation[index], work.focal)
    by_point = point_jacobian(in_camera, work.focal) if relief is not None else None
    for k, t in enumerate(index):
        slope = work.strip.gradient(t, pixels[k])
        on = np.isfinite(values[k] + slope.sum(1)) & (texture.weight > 0)
        if on.sum() < LEAST_POINTS:
            continue
        columns = [np.einsum("pk,pkd->pd", slope[on], by_pose[k][on]), values[k][on, None]]
        if relief is not None and by_point is not None:
            along = relief[0][on] @ poses.rotation[t].T
            moved = np.einsum("pk,pkd,pd->p", slope[on], by_point[k][on], along)
            columns.insert(1, moved[:, None] * relief[1][on])
        weight = texture.weight[on]
        clean, fit = without_gain(np.concatenate(columns, 1), texture.mean[on], weight)
        # values = offset + gain * texture + residual: compare in the texture's contrast.
        gain = fit[1, -1]
        if gain < LEAST_GAIN:
            continue
        clean /= gain
        robust = huber_weight(np.abs(clean[:, -1]) * np.sqrt(weight)) * weight / CORRELATED
        yield FrameEquations(int(t), clean[:, :-1], clean[:, -1], robust)


def pixel_equations(
    poses: Poses, seen: Observations, work: Alignment, texture: Texture
) -> NormalEquations:
    """Photometric part of a pose step, 0 for frames that are not usable."""
    frames = len(poses)
    diagonal, right = np.zeros((frames, DOF, DOF)), np.zeros((frames, DOF))
    for one in frame_equations(poses, seen, work, texture):
        weighted = one.jacobian * one.weight[:, None]
        diagonal[one.frame] = weighted.T @ one.jacobian
        right[one.frame] = -weighted.T @ one.residual
    return NormalEquations(diagonal, right)


def refine(
    poses: Poses,
    work: Alignment,
    texture: Texture,
    shape: np.ndarray,
    seen: Observations,
    progress: Callable[[float], None],
) -> Poses:
    """Poses that align the skin's pixels with a texture, from a start within a few px.

    Args:
        shape: (P, 3) rigid landmarks, observed by ``seen``.
    """
    for done in range(STEPS):
        rest = beside_pixels(poses, shape, seen)
        pixels = pixel_equations(poses, seen, work, texture)
        both = NormalEquations(rest.diagonal + pixels.diagonal, rest.right + pixels.right)
        step = solve_band(*smoothed_system(poses, both, seen, SLACK))
        poses = poses.stepped(step.reshape(-1, DOF))
        progress((done + 1) / STEPS)
    return poses


def beside_pixels(poses: Poses, shape: np.ndarray, seen: Observations) -> NormalEquations:
    """What holds a pose where pixels do not see: weak landmarks, and the outline of the head.

    Args:
        shape: (P, 3) rigid landmarks; the last are the corners of the eyes.
    """
    sigma = point_sigmas(poses, shape, seen) * np.sqrt(LANDMARK_INFLATION)
    marks = landmark_equations(poses, shape, seen, sigma)
    if seen.silhouette is None:
        return marks
    corners = shape[-len(EYE_CORNERS) :]
    outline = silhouette.equations(seen.silhouette, poses, corners, seen.focal, seen.centre)
    return NormalEquations(marks.diagonal + outline.diagonal, marks.right + outline.right)


def all_samples(poses: Poses, frames: np.ndarray, work: Alignment) -> np.ndarray:
    """Grey values (K, N) float32 of the given frames, NaN where not seen."""
    parts = ((poses, frames[p : p + CHUNK]) for p in range(0, len(frames), CHUNK))
    return np.concatenate([values for values, _ in in_order(work.samples, parts)])


def residual_shift(poses: Poses, frames: np.ndarray, work: Alignment) -> np.ndarray:
    """How far the upper face still moves once the poses are taken out: (K, 2) px a frame.

    Every frame's skin, seen from one view, is compared with the mean of the given frames: the
    shift that best explains the difference, gain and offset free. Its root mean square is the
    score of a track. Landmarks cannot give it, as they jitter themselves. Points are weighted as in
    the refinement, by how steady they are and by Huber's loss: a forehead that wrinkles under
    raised brows moves on the skull and is no fault of the pose.
    """
    values = all_samples(poses, frames, work)
    texture = texture_of(values)
    in_camera = to_camera(poses[frames], work.skin.points)
    pixels = project(in_camera, work.focal, work.centre[frames])
    out = np.zeros((len(frames), 2))
    for k, t in enumerate(frames):
        slope = work.strip.gradient(t, pixels[k])
        on = np.isfinite(values[k] + slope.sum(1)) & (texture.weight > 0)
        weight = texture.weight[on]
        columns = np.concatenate((slope[on], values[k][on, None]), axis=1)
        clean, _ = without_gain(columns, texture.mean[on], weight)
        slopes, difference = clean[:, :2], clean[:, 2]
        for _ in range(SCORE_STEPS):
            left = difference + slopes @ out[k]
            sure = weight * huber_weight(np.abs(left) * np.sqrt(weight))
            weighted = slopes * sure[:, None]
            # A point that lies d further shows what the texture has d before.
            out[k] = -np.linalg.solve(weighted.T @ slopes, weighted.T @ difference)
    return out


def root_mean_square(shift: np.ndarray) -> float:
    """Of the lengths of shifts (K, 2), px; rows of NaN do not count."""
    return float(np.sqrt(np.nanmean((shift**2).sum(1))))
