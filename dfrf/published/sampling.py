"""Samples along rays: stratified depths, then more where the coarse pass hit something.

R rays, S samples. Depths grow along a ray.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

# Keeps the distribution proper where all weights are zero.
MIN_WEIGHT = 1e-5


def stratified(
    near: Float[Tensor, " R"],
    far: Float[Tensor, " R"],
    count: int,
    jitter: Float[Tensor, "R S"] | None = None,
) -> Float[Tensor, "R S"]:
    """Depths spread evenly from near to far, both included.

    Args:
        near: first depth of each ray.
        far: last depth of each ray.
        count: S, at least 2.
        jitter: where in its stratum each depth lies, 0..1; None for the even ones. The last depth
            stays at far all the same: it carries the background.
    """
    t = torch.linspace(0, 1, count, dtype=near.dtype, device=near.device)
    depths = near[:, None] * (1 - t) + far[:, None] * t
    if jitter is None:
        return depths
    middle = (depths[:, 1:] + depths[:, :-1]) / 2
    upper = torch.cat([middle, depths[:, -1:]], -1)
    lower = torch.cat([depths[:, :1], middle], -1)
    moved = lower + (upper - lower) * jitter
    return torch.cat([moved[:, :-1], depths[:, -1:]], -1)


def inverse_cdf(
    edges: Float[Tensor, "R B"], weights: Float[Tensor, "R B-1"], u: Float[Tensor, "#R S"]
) -> Float[Tensor, "R S"]:
    """Depths drawn from the piecewise constant density that weights give on bins (NeRF, 5.2).

    Args:
        edges: of the bins.
        weights: of the bins, not negative; they need not sum to 1.
        u: numbers in 0..1 to be sent through the inverse of the cumulative distribution.
    """
    weights = weights + MIN_WEIGHT
    cdf = (weights / weights.sum(-1, keepdim=True)).cumsum(-1)
    cdf = torch.cat([torch.zeros_like(cdf[:, :1]), cdf], -1)
    u = u.expand(edges.shape[0], -1).contiguous()
    after = torch.searchsorted(cdf, u, right=True)
    below = (after - 1).clamp_min(0)
    above = after.clamp_max(cdf.shape[-1] - 1)
    cdf_below, cdf_above = cdf.gather(-1, below), cdf.gather(-1, above)
    share = cdf_above - cdf_below
    share = torch.where(share < MIN_WEIGHT, torch.ones_like(share), share)
    edge_below, edge_above = edges.gather(-1, below), edges.gather(-1, above)
    return edge_below + (u - cdf_below) / share * (edge_above - edge_below)


def importance(
    depths: Float[Tensor, "R S"], weights: Float[Tensor, "R S"], u: Float[Tensor, "#R I"]
) -> Float[Tensor, "R S+I"]:
    """The coarse depths with I more between them, sorted; no gradient flows into the new ones.

    Args:
        depths: of the coarse pass.
        weights: rendering weights of the coarse pass. The first and the last do not count: bins lie
            between the middles of neighbouring depths.
        u: numbers in 0..1; evenly spread ones draw the same depths every time.
    """
    middle = (depths[:, 1:] + depths[:, :-1]) / 2
    drawn = inverse_cdf(middle, weights[:, 1:-1], u).detach()
    return torch.cat([depths, drawn], -1).sort(-1).values
