"""Volume rendering, equation (8), over S samples along each ray, nearest first.

The background is separate: C = sum_i w_i c_i + (1 - sum_i w_i) background, so that an image can be
composited again without rendering. Samples with opacity 0 are padding and change nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True)
class Rendering:
    """Rendered rays.

    Attributes:
        weights: (..., S), w_i = T_i alpha_i.
        colour: (..., 3), premultiplied: sum_i w_i c_i, without the background.
        opacity: (...), sum_i w_i.
        depth: (...), sum_i w_i t_i in the unit of the distances, not divided by the opacity.
    """

    weights: Float[Tensor, "*B S"]
    colour: Float[Tensor, "*B 3"]
    opacity: Float[Tensor, "*B"]
    depth: Float[Tensor, "*B"]

    def over(self, background: Float[Tensor, "*#B 3"]) -> Float[Tensor, "*B 3"]:
        """The colour in front of a background."""
        return self.colour + (1 - self.opacity)[..., None] * background


def opacities(thickness: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
    """alpha = 1 - exp(-tau) of optical thickness tau = density times length of the sample."""
    return -torch.expm1(-thickness)


def transmittance(opacity: Float[Tensor, "*B S"]) -> Float[Tensor, "*B S"]:
    """T_i = prod_{j<i} (1 - alpha_j): the light that reaches sample i."""
    ones = torch.ones_like(opacity[..., :1])
    return torch.cat([ones, 1 - opacity[..., :-1]], -1).cumprod(-1)


def composite(
    colours: Float[Tensor, "*B S 3"],
    opacity: Float[Tensor, "*B S"],
    distances: Float[Tensor, "*B S"],
) -> Rendering:
    """Integrates colours along rays.

    Args:
        colours: of each sample.
        opacity: of each sample, 0..1; from densities, `opacities(density * length)`.
        distances: t_i of each sample.
    """
    weights = transmittance(opacity) * opacity
    return Rendering(
        weights=weights,
        colour=(weights[..., None] * colours).sum(-2),
        opacity=weights.sum(-1),
        depth=(weights * distances).sum(-1),
    )
