"""Regularizers that keep the density on a surface: matte, distortion, depth of the mean face.

R rays, S slots a ray, nearest first.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

UNSURE = 0.05  # a matte further than this from 0 and 1 is unsure


def matte_loss(opacity: Float[Tensor, " B"], matte: Float[Tensor, " B"]) -> Float[Tensor, ""]:
    """Mean squared difference of opacity and matte, 0..1, where the matte is sure.

    A soft edge of a matte is a guess. The background is known there, so the colours of the image
    determine the opacity.
    """
    sure = ((matte - 0.5).abs() > 0.5 - UNSURE).to(matte.dtype)
    return (sure * (opacity - matte) ** 2).mean()


def distortion_loss(
    weights: Float[Tensor, "R S"], distances: Float[Tensor, "R S"], step: float
) -> Float[Tensor, ""]:
    """Distortion of the weights along rays (mip-NeRF 360, equation 15), mean over rays.

    sum_ij w_i w_j |t_i - t_j| + 1/3 sum_i w_i^2 step, computed with running sums since the samples
    of a ray are in order.

    Args:
        weights, distances: a weight of 0 is padding, whatever its distance.
        step: length of a sample.
    """
    before = weights.cumsum(-1) - weights
    moment = (weights * distances).cumsum(-1) - weights * distances
    between = 2 * (weights * (distances * before - moment)).sum(-1)
    within = (weights**2).sum(-1) * step / 3
    return (between + within).mean()


def surface_loss(
    depth: Float[Tensor, " R"],
    opacity: Float[Tensor, " R"],
    distance: Float[Tensor, " R"],
    margin: float = 0.2,
) -> Float[Tensor, ""]:
    """Mean distance of the rendered surface from the mean face, clipped at half a unit.

    Args:
        depth: sum of w_i t_i.
        opacity: sum of w_i; light that passes counts as a surface `margin` behind the face.
        distance: of the face along the ray, head units.
    """
    gap = depth + (1 - opacity) * (distance + margin) - distance
    return torch.clamp(gap.abs(), max=0.5).mean()
