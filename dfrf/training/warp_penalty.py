"""The warp penalty of the loss: equations (5) and (6).

Offsets are in pixels of a 512 pixel image, the paper's unit, which lambda is given for
(`TrainConfig.warp_weight`). `dfrf.fast.fast_loss` and `dfrf.published.paper_loss` hold the whole
loss, equation (9).

N references, P points.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

PAPER_SIZE = 512


def warp_length(offsets: Float[Tensor, "N *P 2"]) -> Float[Tensor, "*P"]:
    """sqrt(du^2 + dv^2), mean over the references; its mean over points is L_r of equation (5).

    Its gradient at an offset of zero is zero.
    """
    return torch.linalg.vector_norm(offsets, dim=-1).mean(0)


def weighted_warp_penalty(
    offsets: Float[Tensor, "N *P 2"], opacity: Float[Tensor, "*P"]
) -> Float[Tensor, ""]:
    """L_r' of equation (6): lengths weighted by 1 - sigma, point by point.

    A density has no upper bound, so sigma is read as the opacity of the sample, 0..1. It is a
    weight: no gradient flows into it, or points could grow opaque to escape the penalty.

    (The published code takes half the squared length, and rendering weight times depth for sigma.)
    """
    return ((1 - opacity.detach()) * warp_length(offsets)).mean()
