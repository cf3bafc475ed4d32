"""The radiance MLP F_theta of equations (2) and (7): colour and density of points."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.encodings import DIRECTION_OCTAVES, POINT_OCTAVES, encoded_size

# Density of the published model where the raw density is 0, per unit of length.
MIN_DENSITY = 1e-6


def density(raw: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
    """Density from the network's raw output, per unit of length of the world."""
    return F.relu(raw) + MIN_DENSITY


class RadianceMLP(nn.Module):
    """Eight layers with a skip for the density, three more with the view direction for the colour.

    Args:
        input_dim: width of all that describes a point: aggregated reference feature, encoded point,
            speech code, in that order (256 + 63 + 64); a plain NeRF has the point alone.
        direction_dim: width of the encoded view direction.
        width, depth: of the layers before the density.
        skip: the layer that sees the whole input again, before its hidden state.
        colour_width, colour_depth: of the layers before the colour.
    """

    def __init__(
        self,
        *,
        input_dim: int = 256 + encoded_size(POINT_OCTAVES) + 64,
        direction_dim: int = encoded_size(DIRECTION_OCTAVES),
        width: int = 256,
        depth: int = 8,
        skip: int = 5,
        colour_width: int = 128,
        colour_depth: int = 3,
    ) -> None:
        super().__init__()
        self.skip = skip
        sizes = [input_dim] + [width] * (depth - 1)
        sizes[skip] += input_dim
        self.layers = nn.ModuleList(nn.Linear(size, width) for size in sizes)
        self.density = nn.Linear(width, 1)
        sizes = [width + direction_dim] + [colour_width] * (colour_depth - 1)
        self.colour_layers = nn.ModuleList(nn.Linear(size, colour_width) for size in sizes)
        self.colour = nn.Linear(colour_width, 3)

    def forward(
        self, inputs: Float[Tensor, "*B I"], directions: Float[Tensor, "*B V"]
    ) -> tuple[Float[Tensor, "*B 3"], Float[Tensor, "*B"]]:
        """Raw colour (before the sigmoid) and raw density (before `density`)."""
        h = inputs
        for i, layer in enumerate(self.layers):
            if i == self.skip:
                h = torch.cat([inputs, h], -1)
            h = F.relu(layer(h))
        raw_density = self.density(h).squeeze(-1)
        c = torch.cat([h, directions], -1)
        for layer in self.colour_layers:
            c = F.relu(layer(c))
        return self.colour(c), raw_density
