"""What keeps the density on a surface: the distortion loss and the depth of the mean face.

R rays, S slots a ray, nearest first.
"""

from __future__ import annotations

import torch
from torch import Tensor


def distortion_loss(weights: Tensor, distances: Tensor, step: float) -> Tensor:
    """Distortion of the weights along rays (mip-NeRF 360, equation 15), mean over rays.

    sum_ij w_i w_j |t_i - t_j| + 1/3 sum_i w_i^2 step, computed with running sums since the samples
    of a ray are in order.

    Args:
        weights, distances: (R, S); a weight of 0 is padding, whatever its distance.
        step: length of a sample.
    """
    before = weights.cumsum(-1) - weights
    moment = (weights * distances).cumsum(-1) - weights * distances
    between = 2 * (weights * (distances * before - moment)).sum(-1)
    within = (weights**2).sum(-1) * step / 3
    return (between + within).mean()


def surface_loss(depth: Tensor, opacity: Tensor, distance: Tensor, margin: float = 0.2) -> Tensor:
    """Mean distance, cut off at half a unit, of the rendered surface from the mean face.

    Args:
        depth: (R,) sum of w_i t_i.
        opacity: (R,) sum of w_i; light that passes counts as a surface `margin` behind the face.
        distance: (R,) of the face along the ray, head units.
    """
    gap = depth + (1 - opacity) * (distance + margin) - distance
    return torch.clamp(gap.abs(), max=0.5).mean()
