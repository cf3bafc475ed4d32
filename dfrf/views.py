"""Reference frames of a person, and the features read off them.

N references of H x W pixels, C feature channels, U measures of the upper face.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor


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
    """

    images: Tensor
    mattes: Tensor
    c2w: Tensor
    focal: float
    centres: Tensor
    upper: Tensor
    eyes: Tensor
    scale: float

    def to(self, device: torch.device) -> ReferenceViews:
        """The same views on a device."""
        return ReferenceViews(
            self.images.to(device),
            self.mattes.to(device),
            self.c2w.to(device),
            self.focal,
            self.centres.to(device),
            self.upper.to(device),
            self.eyes.to(device),
            self.scale,
        )


@dataclass(frozen=True)
class ReferenceMaps:
    """Reference features F_n as one channels-last table, (N * H * W, C), with their cameras."""

    table: Tensor
    height: int
    width: int
    views: ReferenceViews

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
