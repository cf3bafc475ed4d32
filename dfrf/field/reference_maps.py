"""Feature maps of a person's reference views.

N references of H x W pixels, n of them read, C feature channels, M points, Q lip points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf import device as devices
from dfrf.field.reference_views import ReferenceViews

# Power by which a view's weight falls with its angle, to 0 at the first view left out.
FADE = 6
MIN_WEIGHT = 1e-4  # of a view: its logarithm is taken


def bilinear_rows(
    points: Float[Tensor, "*P 2"], height: int, width: int, first: Int[Tensor, "*#P"]
) -> tuple[Int[Tensor, "*P 4"], Float[Tensor, "*P 4"]]:
    """The four table rows round each position and their bilinear weights.

    Args:
        points: column, row; clamped to the image.
        height, width: of an image, pixels.
        first: row of the table where the image of each point begins.

    Returns:
        Rows, and weights, differentiable in the points.
    """
    # NaN would become an arbitrary index: the loss reports it, nothing outside the table is read.
    column, row = points.nan_to_num().unbind(-1)
    column, row = column.clamp(0, width - 1), row.clamp(0, height - 1)
    left = column.detach().floor().clamp_(max=width - 2)
    top = row.detach().floor().clamp_(max=height - 2)
    a, b = column - left, row - top
    index = first + top.long() * width + left.long()
    rows = torch.stack([index, index + 1, index + width, index + width + 1], -1)
    weights = torch.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], -1)
    return rows, weights


@dataclass(frozen=True)
class ReferenceMaps:
    """Reference features F_n as one channels-last table, R = N * H * W rows, with their cameras.

    Attributes:
        features: the table: of all pixels of all references, row-major.
        height, width: of a reference, pixels.
        views: the views that are read, some of those in the table.
        number: index of each of them in the table.
        log_view_weight: logarithm of the weight of each view before attention.
        mouths: maps of `views.mouths`; None without.
        chosen: the mouth crops that each frame of a batch reads; empty before the choice.
    """

    features: Float[Tensor, "R C"]
    height: int
    width: int
    views: ReferenceViews
    number: Int[Tensor, " n"]
    log_view_weight: Float[Tensor, " n"]
    mouths: ReferenceMaps | None = None
    chosen: tuple[ChosenMouths, ...] = ()

    @classmethod
    def of(cls, table: Float[Tensor, "R C"], views: ReferenceViews) -> Self:
        """All views, with their features."""
        count, height, width = views.mattes.shape
        number = torch.arange(count, device=table.device)
        return cls(table, height, width, views, number, torch.zeros(count, device=table.device))

    def select_nearest_views(self, origin: Float[Tensor, 3], count: int) -> ReferenceMaps:
        """The `count` references whose viewpoints are nearest to `origin`.

        The weight of a view fades before another takes its place, so that nothing jumps while a
        head turns.

        Args:
            origin: head frame.
            count: of views.

        Returns:
            Maps with the same table, whose views have no images.
        """
        viewpoints = F.normalize(self.views.c2w[:, :, 3], dim=-1)
        if len(viewpoints) <= count:
            return self
        turned = (viewpoints - F.normalize(origin, dim=0)).norm(dim=-1)
        turned, nearest = turned.topk(count + 1, largest=False)
        weight = 1 - (turned[:-1] / turned[-1].clamp_min(MIN_WEIGHT)) ** FADE
        return self.only(nearest[:-1], weight.clamp_min(MIN_WEIGHT).log())

    def only(self, chosen: Int[Tensor, " k"], log_view_weight: Float[Tensor, " k"]) -> Self:
        """Some of the views, with the same table and without images."""
        views = self.views
        return replace(
            self,
            views=replace(
                views,
                images=views.images[:0],
                mattes=views.mattes[:0],
                c2w=views.c2w[chosen],
                centres=views.centres[chosen],
            ),
            number=self.number[chosen],
            log_view_weight=log_view_weight,
        )

    def first_rows(self) -> Int[Tensor, "n 1"]:
        """Row of the table where each of the views begins."""
        return self.number[:, None] * (self.height * self.width)

    def read_nearest(self, positions: Float[Tensor, "n M 2"]) -> Float[Tensor, "n M C"]:
        """Features of the pixels nearest to positions, without a gradient.

        The published code feeds the warp with features that it does not train, and so do we. A
        gradient would cost a second look-up and improved nothing.
        """
        limit = positions.new_tensor([self.width - 1, self.height - 1])
        pixel = torch.minimum(positions.round().clamp_min(0), limit).long()
        row = self.first_rows() + pixel[..., 1] * self.width + pixel[..., 0]
        read = self.features.detach().index_select(0, row.view(-1)).view(*row.shape, -1)
        return read.to(devices.matrix_type(read.device))

    def read_bilinear(self, positions: Float[Tensor, "n M 2"]) -> Float[Tensor, "n M C"]:
        """Features between the pixels of the views."""
        rows, weights = bilinear_rows(positions, self.height, self.width, self.first_rows())
        read = F.embedding_bag(
            rows.view(-1, 4),
            self.features,
            mode="sum",
            per_sample_weights=weights.view(-1, 4).to(self.features.dtype),
        ).view(*positions.shape[:2], self.features.shape[1])
        return read.to(devices.matrix_type(read.device))

    def as_type(self, kind: torch.dtype) -> ReferenceMaps:
        """The same maps with a table of another type."""
        mouths = None if self.mouths is None else self.mouths.as_type(kind)
        return replace(self, features=self.features.to(kind), mouths=mouths)


@dataclass(frozen=True)
class ChosenMouths:
    """The few mouth crops that a frame reads.

    Attributes:
        maps: of these.
        at: wanted positions of points of the lips, x and y in the head frame.
        motion: weights of Gaussians round these points, whose sum moves them to where each crop
            shows them, pixels of the crop.
    """

    maps: ReferenceMaps
    at: Float[Tensor, "Q 2"]
    motion: Float[Tensor, "n Q 2"]
