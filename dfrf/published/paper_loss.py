"""The loss of the published model: equation (9) over both passes. R rays."""

from __future__ import annotations

import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.training.warp_penalty import PAPER_SIZE, weighted_warp_penalty


def paper_loss(
    rendered: dict[str, Tensor], target: Float[Tensor, "R 3"], size: int, warp_weight: float
) -> Float[Tensor, ""]:
    """Equation (9) over both passes, L_r' over the fine samples as published.

    Args:
        rendered: what `PaperModel` returns.
        target: colours of the frame.
        size: side of the references in pixels, which offsets are brought to 512 from.
        warp_weight: lambda.
    """
    loss = F.mse_loss(rendered["colour"], target)
    loss = loss + F.mse_loss(rendered["coarse_colour"], target)
    if rendered["offset"].numel():
        offset = rendered["offset"] * (PAPER_SIZE / size)
        loss = loss + warp_weight * weighted_warp_penalty(offset, rendered["alpha"])
    return loss
