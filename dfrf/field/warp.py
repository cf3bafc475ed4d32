"""Face warping: the offset that moves a projected point to where its feature really is.

M points, N references, F frames in a batch, C feature channels. Positions are (column, row).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.config import FieldConfig
from dfrf.field.query import per_point

# Offsets grow with the network's output by so many pixels, as if there were no limit.
SLOPE = 10.0


class Warp(nn.Module):
    """D_eta of equation (3): three layers; the part of a point and its frame is computed once."""

    def __init__(self, config: FieldConfig, point_dim: int) -> None:
        super().__init__()
        self.max_offset = config.max_offset
        self.point = nn.Linear(point_dim, 64)
        self.conditioning = nn.Linear(config.cond_dim, 64, bias=False)
        self.feature = nn.Linear(config.feature_dim, 64, bias=False)
        self.hidden = nn.Linear(64, 32)
        self.out = nn.Linear(32, 2)
        nn.init.normal_(self.out.weight, std=1e-3)
        nn.init.zeros_(self.out.bias)

    def forward(
        self,
        point: Float[Tensor, "M E"],
        conditioning: Float[Tensor, "F K"],
        belongs: Float[Tensor, "M F"],
        feature: Float[Tensor, "N M C"],
    ) -> Float[Tensor, "N M 2"]:
        """Offsets, pixels at 512.

        Args:
            point: encoded points.
            conditioning: of each frame.
            belongs: 1 where a point belongs to a frame.
            feature: of each reference where the point projects.
        """
        shared = self.point(point) + per_point(self.conditioning(conditioning), belongs)
        # Equation (3): (du, dv) = D_eta(p, A, F_n(u, v)).
        h = F.relu(self.feature(feature).add_(shared), inplace=True)
        raw = self.out(F.relu(self.hidden(h), inplace=True)).float()
        return self.max_offset * torch.tanh(raw * (SLOPE / self.max_offset))
