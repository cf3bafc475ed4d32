"""Brows move as skin does: what a field has learned of a brow is moved with it, not learned anew.

A field that knows only how high a brow is has to guess a brow higher than it ever saw. One that
knows where the skin came from need not. M points, T frames.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

MEASURES = slice(2, 4)  # of the upper face: the left and the right brow, in LENGTH
LENGTH = 0.03  # of the distance between the outer corners of the eyes: what counts as 1
EYE_DISTANCE = 0.9  # head units
# Head units, y up, z to the front: brows are at (+-.42, .49, .65), lids below .33, the hair at .8.
LID, BROW, FOREHEAD, HAIR = 0.3, 0.48, 0.62, 1.0
LARGEST = 4.0  # a measure beyond that is taken for this: skin would fold
MIDDLE = 0.12  # half the width of the strip between the brows where both count
TEMPLE, SIDE = 0.6, 0.9  # from here to there outwards the skin comes to rest
EAR, FRONT = 0.0, 0.3  # from here to there forwards it begins to move
RARE = 0.05  # share of the frames at either end


def ramp(values: Float[Tensor, "*B"], start: float, end: float) -> Float[Tensor, "*B"]:
    """0 at the start, 1 at the end, smooth between and constant beyond."""
    x = ((values - start) / (end - start)).clamp(0, 1)
    return x * x * (3 - 2 * x)


def motion_weights(points: Float[Tensor, "M 3"]) -> Float[Tensor, "M 2"]:
    """How much of the motion of the left and of the right brow each point takes part in."""
    x, y, z = points.unbind(-1)
    height = ramp(y, LID, BROW) * ramp(y, HAIR, FOREHEAD)
    both = height * ramp(x.abs(), SIDE, TEMPLE) * ramp(z, EAR, FRONT)
    right = ramp(x, -MIDDLE, MIDDLE)
    return torch.stack([both * (1 - right), both * right], -1)


def brow_range(measures: Float[Tensor, "T 2"]) -> Float[Tensor, "2 2"]:
    """Least and most that each brow is up in all but rare frames.

    Where no reference shows it, a brow raised as high as hardly ever is drawn twice over. A measure
    of 1 does no harm, whatever it was: perspective changes it as much in another shot.
    """
    low, high = torch.quantile(measures, measures.new_tensor([RARE, 1 - RARE]), dim=0)
    return torch.stack([low.clamp_max(-1), high.clamp_min(1)])


def lifts(
    weights: Float[Tensor, "M 2"], measures: Float[Tensor, "*N #M 2"]
) -> Float[Tensor, "*N M"]:
    """How far up skin is moved by brow measures, head units.

    Args:
        weights: see `motion_weights`.
        measures: of one frame for all points, or of each point's.
    """
    (left, right), measured = weights.unbind(-1), measures.clamp(-LARGEST, LARGEST)
    return (left * measured[..., 0] + right * measured[..., 1]) * (LENGTH * EYE_DISTANCE)


def lowered(
    points: Float[Tensor, "*N M 3"], lift: Float[Tensor, "*N M"]
) -> Float[Tensor, "*N M 3"]:
    """Points moved down by lifts, head units."""
    return torch.cat([points[..., :1], points[..., 1:2] - lift[..., None], points[..., 2:]], -1)
