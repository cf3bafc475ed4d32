"""Reference frames of a person, and the features read off them.

N references of H x W pixels, C feature channels, U measures of the upper face.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.cameras import project

FADE = 6  # power by which a reference's say falls with its turn, to nothing at the first left out
LEAST = 1e-4  # of a say, whose logarithm is taken


def bilinear_rows(points: Tensor, height: int, width: int, first: Tensor) -> tuple[Tensor, Tensor]:
    """The four table rows round each position and their bilinear weights.

    Args:
        points: (..., 2) column, row; clamped to the image.
        first: (...,) row of the table where the image of each point begins.

    Returns:
        (..., 4) int64 and (..., 4) weights, differentiable in the points.
    """
    # Not a number would become any index: the loss says so without reading outside the table.
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
class ReferenceViews:
    """Reference frames, cut to the head, before the CNN.

    Attributes:
        images: (N, H, W, 3) uint8.
        mattes: (N, H, W) uint8.
        c2w: (N, 3, 4); focal in pixels; centres (N, 2), of the cut.
        upper: (N, U) measures of the upper face.
        eyes: (2, 7) where the person's eyes are, see `lids`.
        scale: pixels of the reference for one pixel at a 512 crop (the unit of the warp).
        blinks: 1 where the last view is of shut eyes, and only lids are read off it, else 0.
    """

    images: Tensor
    mattes: Tensor
    c2w: Tensor
    focal: float
    centres: Tensor
    upper: Tensor
    eyes: Tensor
    scale: float
    blinks: int = 0

    def to(self, device: torch.device) -> ReferenceViews:
        """The same views on a device."""
        return replace(
            self,
            images=self.images.to(device),
            mattes=self.mattes.to(device),
            c2w=self.c2w.to(device),
            centres=self.centres.to(device),
            upper=self.upper.to(device),
            eyes=self.eyes.to(device),
        )

    def project(self, points: Tensor, views: slice, below: Tensor) -> Tensor:
        """Where n views show points (M, 3) that are `below` (n, M) lower there, (n, M, 2)."""
        return project(points, self.c2w[views], self.focal, self.centres[views], below)

    def differences(self, points: Tensor, directions: Tensor, views: slice) -> Tensor:
        """How unit directions (M, 3) differ from those in which n views see the points, (n, M, 4).

        The difference of the two, then the cosine of the angle between them.
        """
        towards = F.normalize(points - self.c2w[views, None, :, 3], dim=-1)
        return torch.cat([directions - towards, (directions * towards).sum(-1, keepdim=True)], -1)

    @property
    def faces(self) -> slice:
        """The views that whole faces are read off."""
        return slice(0, self.c2w.shape[0] - self.blinks)

    @property
    def shut(self) -> slice:
        """The view, if any, that lids of shut eyes are read off."""
        return slice(self.c2w.shape[0] - self.blinks, self.c2w.shape[0])


@dataclass(frozen=True)
class ReferenceMaps:
    """Reference features F_n as one channels-last table, (N * H * W, C), with their cameras.

    Attributes:
        views: the views that are looked at, some of those in the table.
        number: (n,) which of the table's each of them is.
        say: (n,) logarithm of how much say each has, where all else is equal.
    """

    table: Tensor
    height: int
    width: int
    views: ReferenceViews
    number: Tensor
    say: Tensor

    @classmethod
    def of(cls, table: Tensor, views: ReferenceViews) -> Self:
        """All views, with features (N * H * W, C)."""
        count, height, width = views.mattes.shape
        number = torch.arange(count, device=table.device)
        return cls(table, height, width, views, number, torch.zeros(count, device=table.device))

    def near(self, origin: Tensor, count: int) -> ReferenceMaps:
        """Those of `count` references that show the head most nearly as it is seen from `origin`.

        The say of a reference fades before another takes its place, so that nothing jumps while a
        head turns.

        Args:
            origin: (3,) head frame.

        Returns:
            Maps with the same table, whose views have no pictures any more.
        """
        views = self.views
        faces = F.normalize(views.c2w[views.faces, :, 3], dim=-1)
        if len(faces) <= count:
            return self
        turned = (faces - F.normalize(origin, dim=0)).norm(dim=-1)
        turned, nearest = turned.topk(count + 1, largest=False)
        share = 1 - (turned[:-1] / turned[-1].clamp_min(LEAST)) ** FADE
        some = torch.cat([nearest[:-1], torch.arange(len(faces), len(self.number)).to(nearest)])
        return replace(
            self,
            views=replace(
                views,
                images=views.images[:0],
                mattes=views.mattes[:0],
                c2w=views.c2w[some],
                centres=views.centres[some],
                upper=views.upper[some],
            ),
            number=self.number[some],
            say=torch.cat([share.clamp_min(LEAST).log(), self.say[views.shut]]),
        )

    def first_rows(self, views: slice) -> Tensor:
        """Row of the table where each of the views begins, (n, 1)."""
        return self.number[views, None] * (self.height * self.width)

    def nearest(self, positions: Tensor, views: slice) -> Tensor:
        """Features (n, M, C) of the pixels nearest to positions (n, M, 2), as they were stored.

        Nothing is learned through them: the published code feeds the warp with features that it
        does not train, and so do we. Their gradient would cost a second look-up and taught nothing.
        """
        limit = positions.new_tensor([self.width - 1, self.height - 1])
        pixel = torch.minimum(positions.round().clamp_min(0), limit).long()
        row = self.first_rows(views) + pixel[..., 1] * self.width + pixel[..., 0]
        return self.table.detach().index_select(0, row.view(-1)).view(*row.shape, -1)

    def read(self, positions: Tensor, views: slice) -> Tensor:
        """Features (n, M, C) of n of the views between the pixels at positions (n, M, 2)."""
        rows, weights = bilinear_rows(positions, self.height, self.width, self.first_rows(views))
        return F.embedding_bag(
            rows.view(-1, 4),
            self.table,
            mode="sum",
            per_sample_weights=weights.view(-1, 4).to(self.table.dtype),
        ).view(*positions.shape[:2], self.table.shape[1])

    def as_type(self, kind: torch.dtype) -> ReferenceMaps:
        """The same maps with a table of another type."""
        return self.with_features(self.table.to(kind))

    @property
    def features(self) -> Tensor:
        """The table, through which the CNN learns."""
        return self.table

    def with_features(self, features: Tensor) -> Self:
        """The same references with another table."""
        return replace(self, table=features)
