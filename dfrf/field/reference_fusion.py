"""How the `fast` field reads references: their encoder, the warp and the attention over them.

M points, N references, F frames in a batch, C feature channels.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from dfrf.config import FieldConfig
from dfrf.field.reference_maps import ReferenceMaps, ReferenceViews
from dfrf.published.references import sharpened

COLOUR = slice(0, 3)  # of the features of a reference


def of_points(values: Tensor, belongs: Tensor) -> Tensor:
    """Values of frames (F, K) for each of M points, (M, K), or (1, K) where there is one frame.

    A product with `belongs` (M, F) instead of an index: the gradient of indexing is added up by
    several threads in any order, and training would not be the same twice.
    """
    return values if values.shape[0] == 1 else belongs @ values


def weighted_sum(weights: Tensor, values: Tensor) -> Tensor:
    """Sum over the first dimension of values (N, M, C) times weights (N, M, 1), (M, C).

    One after the other: products of all of them at once would not stay in the cache.
    """
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = torch.addcmul(total, weight, value)
    return total


class ReferenceEncoder(nn.Module):
    """Two 3x3 convolutions without down-sampling, then a linear layer a pixel.

    The first four channels of the result are the colour, sharpened, and the matte themselves, so
    that the field can blend what the references really show.
    """

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        width = config.cnn_width
        self.conv1 = nn.Conv2d(4, width, 3, padding=1)
        self.conv2 = nn.Conv2d(width, width, 3, padding=1)
        self.head = nn.Conv2d(width, config.feature_dim - 4, 1)

    def forward(self, views: ReferenceViews) -> ReferenceMaps:
        """Feature table of the references, (N * H * W, C) float32."""
        # One by one: the layers of all of them need not be in memory at once.
        shown = zip(views.images.split(1), views.mattes.split(1), strict=True)
        table = torch.cat([self.features(image, matte).flatten(0, 2) for image, matte in shown])
        return ReferenceMaps.of(table, views)

    def features(self, images: Tensor, mattes: Tensor) -> Tensor:
        """Features (N, H, W, C) of images (N, H, W, 3) and mattes (N, H, W), uint8."""
        matte, colours = mattes[..., None].float() / 255, images.float() / 255
        x = torch.cat([colours, matte], -1).permute(0, 3, 1, 2)
        x = x.contiguous(memory_format=torch.channels_last)
        learned = self.head(F.relu(self.conv2(F.relu(self.conv1(x * 2 - 1)))))
        return torch.cat([sharpened(colours), matte, learned.permute(0, 2, 3, 1)], -1)


class Warp(nn.Module):
    """D_eta of equation (3): three layers; point and speech parts are shared by the references."""

    def __init__(self, config: FieldConfig, point_dim: int) -> None:
        super().__init__()
        self.max_offset = config.max_offset
        self.point = nn.Linear(point_dim, 64)
        self.speech = nn.Linear(config.told_dim, 64, bias=False)
        self.feature = nn.Linear(config.feature_dim, 64, bias=False)
        self.hidden = nn.Linear(64, 32)
        self.out = nn.Linear(32, 2)
        nn.init.normal_(self.out.weight, std=1e-3)
        nn.init.zeros_(self.out.bias)

    def forward(self, point: Tensor, code: Tensor, belongs: Tensor, feature: Tensor) -> Tensor:
        """Offsets (N, M, 2), pixels at 512.

        Args:
            point: (M, P) encoded points.
            code: (F, A) what is told of each frame.
            belongs: (M, F) 1 where a point belongs to a frame.
            feature: (N, M, C) what each reference shows where the point projects.
        """
        shared = self.point(point) + of_points(self.speech(code), belongs)
        h = F.relu(self.feature(feature).add_(shared), inplace=True)
        raw = self.out(F.relu(self.hidden(h), inplace=True)).float()
        return self.max_offset * torch.tanh(raw * (10.0 / self.max_offset))


class Aggregation(nn.Module):
    """One attention over the references; its feature F~ does not depend on their order."""

    def __init__(self, config: FieldConfig, point_dim: int) -> None:
        super().__init__()
        self.feature = nn.Linear(config.feature_dim + 4, config.token_dim, bias=False)
        self.point = nn.Linear(point_dim, config.token_dim)
        self.speech = nn.Linear(config.told_dim, config.token_dim, bias=False)
        self.logit = nn.Linear(config.token_dim, 1)
        self.out_dim = config.token_dim + config.feature_dim + 3

    def forward(
        self,
        feature: Tensor,
        view: Tensor,
        say: Tensor,
        point: Tensor,
        code: Tensor,
        belongs: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Feature (M, out_dim) and weights (N, M) of the references at M points.

        Args:
            feature: (N, M, C); view: (N, M, 4) differences.
            say: (N,) logarithm of how much say each reference has before it is looked at.
            point: (M, P) encoded; code: (F, A) what is told of each frame.
            belongs: (M, F) 1 where a point belongs to a frame.
        """
        shared = self.point(point) + of_points(self.speech(code), belongs)
        token = self.feature(torch.cat([feature, view], -1)).add_(shared)
        token = F.relu(token, inplace=True)
        weight = (self.logit(token).squeeze(-1).float() + say[:, None]).softmax(0)
        w = weight[..., None].to(feature.dtype)
        mean = weighted_sum(w, feature)
        spread = weighted_sum(w, (feature[..., COLOUR] - mean[..., COLOUR]) ** 2)
        return torch.cat([weighted_sum(w, token), mean, spread], -1), weight
