"""Face warping: the offset that moves a projected point to where its feature really is.

N references, P points. Offsets are in pixels of the reference, (column, row) like every position.
"""

from __future__ import annotations

from itertools import pairwise

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.encodings import POINT_OCTAVES, encoded_size

# Largest offset of the published model, in pixels; there is no gradient beyond it.
MAX_OFFSET = 10.0
INITIAL_DEVIATION = 1e-3
WIDTHS = (128, 32)  # of the hidden layers


class WarpMLP(nn.Module):
    """D_eta(p, A, F_n(u_n, v_n)) of equation (3): three layers, one network for all references.

    Starts near the identity: weights of deviation 1e-3 give offsets of about 1e-6 pixels.

    Args:
        point_dim: width of the encoded point.
        code_dim: width of the speech code A; 0 without speech.
        feature_dim: width of the reference features.
        max_offset: where offsets are cut off, pixels.
    """

    def __init__(
        self,
        point_dim: int = encoded_size(POINT_OCTAVES),
        code_dim: int = 64,
        feature_dim: int = 128,
        max_offset: float = MAX_OFFSET,
    ) -> None:
        super().__init__()
        self.max_offset = max_offset
        sizes = (point_dim + code_dim + feature_dim, *WIDTHS)
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes))
        self.out = nn.Linear(WIDTHS[-1], 2)
        for layer in (*self.layers, self.out):
            nn.init.normal_(layer.weight, std=INITIAL_DEVIATION)
            nn.init.zeros_(layer.bias)

    def forward(
        self,
        points: Float[Tensor, "*P E"],
        code: Float[Tensor, " A"],
        features: Float[Tensor, "N *P C"],
    ) -> Float[Tensor, "N *P 2"]:
        """Offsets (column, row) from encoded points, one speech code and looked-up features."""
        shared = torch.cat([points, code.expand(*points.shape[:-1], -1)], -1)
        x = torch.cat([shared.expand(*features.shape[:-1], -1), features], -1)
        for layer in self.layers:
            x = F.relu(layer(x))
        # The published network counts (row, column).
        return self.out(x).flip(-1).clamp(-self.max_offset, self.max_offset)
