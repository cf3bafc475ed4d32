"""Turns and nods of the head, from its outline.

The skin of a face is nearly flat: the pixels that align it hardly determine how far it turns, and
turns of one shot need not fit those of the next. The outline lies a head's depth behind the eyes,
so it moves relative to them when the head turns: by .94 distances of the outer eye corners to the
side for a turn by 1, by .96 up or down for a nod by 1 (rendered heads of six people and hair
styles: .85 to 1.05, and .92 to .99). T frames; angles as the sine of the angle between the camera's
axis and the head's planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.eyes import eye_axes, upwards
from dubbing.preparation.alignment.banded import DOF, NormalEquations, huber_weight
from dubbing.preparation.alignment.camera import Poses, project, to_camera

TURN, NOD = -0.94, 0.96
# Of an outline about its line, in eye distances: hair moves on the skull, most of all on top.
TURN_SIGMA, NOD_SIGMA = 0.006, 0.012
LEAST_SEEN = 0.5  # share of the frames that must show a side of the outline
# Where it is measured, in eye distances: heights above the eyes, places beside their middle.
HEIGHTS = np.arange(0.15, 0.75, 0.03)
PLACES = np.arange(-0.35, 0.36, 0.05)
LEAST_LINES = 0.5  # of these that must meet the outline
CUT_OFF = 0.3  # of opacity at the image's border: the head extends beyond it


@dataclass(frozen=True)
class Silhouette:
    """The outline of the head in every frame.

    Attributes:
        middle: (T, 2) px, midway between the sides of the head at the forehead; NaN where unknown.
        top: (T, 2) px, top of the head above the eyes; NaN where unknown.
    """

    middle: np.ndarray
    top: np.ndarray

    def take(self, index: np.ndarray) -> Silhouette:
        """Some of the frames."""
        return Silhouette(self.middle[index], self.top[index])


def measure(alpha: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle and top (2,) px of a head in an opacity (S, S) float32, NaN where not visible.

    Opacities are summed from the eyes outwards, so edges are found to a fraction of a pixel.

    Args:
        corners: (4, 2) px of the eyes.
    """
    size = len(alpha)
    centre, right, apart = eye_axes(corners)
    level = cv2.getRotationMatrix2D(
        (float(centre[0]), float(centre[1])), float(np.degrees(np.arctan2(*right[::-1]))), 1
    )
    upright = cv2.warpAffine(alpha, level, (size, size))
    middle, top = np.full(2, np.nan), np.full(2, np.nan)
    if not (centre >= 0).all() or not (centre < size).all():
        return middle, top
    column, row = centre.round().astype(int)
    lines = upright[np.clip((centre[1] - HEIGHTS * apart).round().astype(int), 0, size - 1)]
    lines = lines[(lines[:, 0] < CUT_OFF) & (lines[:, -1] < CUT_OFF)]
    if len(lines) > LEAST_LINES * len(HEIGHTS):
        between = (lines[:, column:].sum(1) - lines[:, :column].sum(1)) / 2
        middle = centre + right * (np.median(between) + column - centre[0])
    if not (alpha[0] > CUT_OFF).any():
        at = (centre[0] + PLACES * apart).round().astype(int)
        at = at[(at >= 0) & (at < size)]
        if len(at) > LEAST_LINES * len(PLACES):
            above = np.median(upright[:row, at].sum(0)) + centre[1] - row
            top = centre + upwards(right) * above
    return middle, top


def places(
    outline: Silhouette, poses: Poses, corners: np.ndarray, focal: float, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Middle (T,) to the right of the eyes and top (T,) above them.

    In distances of the corners of the eyes as seen from the front: a turn foreshortens them.

    Args:
        corners: (4, 3) of the eyes, head frame.
        centre: (T, 2) principal points; focal in px.
    """
    eyes, right, apart = eye_axes(project(to_camera(poses, corners), focal, centre))
    unit = apart / np.sqrt(1 - poses.rotation[:, 2, 0] ** 2)
    middle = ((outline.middle - eyes) * right).sum(-1) / unit
    return middle, ((outline.top - eyes) * upwards(right)).sum(-1) / unit


def equations(
    outline: Silhouette, poses: Poses, corners: np.ndarray, focal: float, centre: np.ndarray
) -> NormalEquations:
    """Normal equations of a step of the poses from the outline.

    Each of its places is a linear function of the angle: TURN or NOD times it, plus a constant of
    the clip. Only the rotation's part of the derivative is used: the pixels determine the eyes.
    Arguments are those of :func:`places`.
    """
    rotation, zero = poses.rotation, np.zeros(len(poses))
    diagonal, right = np.zeros((len(poses), DOF, DOF)), np.zeros((len(poses), DOF))
    lines = ((0, TURN, TURN_SIGMA), (1, NOD, NOD_SIGMA))
    for value, (k, slope, sigma) in zip(
        places(outline, poses, corners, focal, centre), lines, strict=True
    ):
        known = np.isfinite(value)
        if known.mean() < LEAST_SEEN:
            continue
        residual = value - slope * rotation[:, 2, k]
        residual = np.where(known, residual - np.median(residual[known]), 0)
        weight = np.where(known, huber_weight(np.abs(residual) / sigma) / sigma**2, 0)
        # A turn of R by w on its left changes its last row by w_x R[1] - w_y R[0].
        turned = np.stack((rotation[:, 1, k], -rotation[:, 0, k], zero), axis=-1)
        jacobian = np.concatenate((-slope * turned, np.zeros((len(poses), 3))), axis=1)
        diagonal += weight[:, None, None] * jacobian[:, :, None] * jacobian[:, None, :]
        right -= (weight * residual)[:, None] * jacobian
    return NormalEquations(diagonal, right)
