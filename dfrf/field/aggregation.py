"""Aggregation: one attention over the references gives one feature a point.

M points, N references, F frames in a batch, C feature channels.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.config import FieldConfig
from dfrf.field.query import per_point
from dfrf.field.reference_encoder import COLOUR


def weighted_sum(
    weights: Float[Tensor, "N M 1"], values: Float[Tensor, "N M C"]
) -> Float[Tensor, "M C"]:
    """Sum of values over the references.

    One after the other: products of all of them at once would not stay in the cache.
    """
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = torch.addcmul(total, weight, value)
    return total


class Aggregation(nn.Module):
    """One attention over the references; its feature F~ does not depend on their order."""

    def __init__(self, config: FieldConfig, point_dim: int) -> None:
        super().__init__()
        self.feature = nn.Linear(config.feature_dim + 4, config.token_dim, bias=False)
        self.point = nn.Linear(point_dim, config.token_dim)
        self.conditioning = nn.Linear(config.cond_dim, config.token_dim, bias=False)
        self.logit = nn.Linear(config.token_dim, 1)
        self.out_dim = config.token_dim + config.feature_dim + 3

    def forward(
        self,
        feature: Float[Tensor, "N M C"],
        view: Float[Tensor, "N M 4"],
        log_view_weight: Float[Tensor, "N M"],
        point: Float[Tensor, "M E"],
        conditioning: Float[Tensor, "F K"],
        belongs: Float[Tensor, "M F"],
    ) -> tuple[Float[Tensor, "M O"], Float[Tensor, "N M"]]:
        """F~ of the points, and the blend weights of the references.

        Args:
            feature: of each reference at the point.
            view: differences of the directions, see `ReferenceViews.direction_differences`.
            log_view_weight: logarithm of the weight of each reference at a point before attention.
            point: encoded points.
            conditioning: of each frame.
            belongs: 1 where a point belongs to a frame.
        """
        shared = self.point(point) + per_point(self.conditioning(conditioning), belongs)
        token = self.feature(torch.cat([feature, view], -1)).add_(shared)
        token = F.relu(token, inplace=True)
        weight = (self.logit(token).squeeze(-1).float() + log_view_weight).softmax(0)
        w = weight[..., None].to(feature.dtype)
        mean = weighted_sum(w, feature)
        spread = weighted_sum(w, (feature[..., COLOUR] - mean[..., COLOUR]) ** 2)
        return torch.cat([weighted_sum(w, token), mean, spread], -1), weight
