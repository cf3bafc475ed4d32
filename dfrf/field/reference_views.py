"""Images of a person that a field reads: whole references, and crops round the mouth.

N references of H x W pixels, P crops, M points; L lip measures, Q points of the lips, I = L + 4.
Positions of lips are relative to those of the mean face, right and down in the image, head units.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from dfrf.cameras import project
from dfrf.device import Movable


@dataclass(frozen=True)
class ReferenceViews(Movable):
    """Reference frames, cut to the head, before the CNN.

    Attributes:
        images, mattes: P of them: all N, or none once their features are computed.
        c2w: camera to head frame.
        focal: pixels.
        centres: principal points of the cut, (column, row).
        scale: pixels of the reference for one pixel at a 512 crop (the unit of the warp).
        mouths: crops round the mouth in many frames, see `mouth_pixels`; None without.
    """

    images: UInt8[Tensor, "P H W 3"]
    mattes: UInt8[Tensor, "P H W"]
    c2w: Float[Tensor, "N 3 4"]
    focal: float
    centres: Float[Tensor, "N 2"]
    scale: float
    mouths: MouthViews | None = None

    def project(self, points: Float[Tensor, "M 3"]) -> Float[Tensor, "N M 2"]:
        """Equation (1): positions of points in the views, pixels."""
        return project(points, self.c2w, self.focal, self.centres)

    def direction_differences(
        self, points: Float[Tensor, "M 3"], directions: Float[Tensor, "M 3"]
    ) -> Float[Tensor, "N M 4"]:
        """Differences of unit directions and the views' directions to the points.

        The difference of the two vectors, then the cosine of the angle between them.
        """
        towards = F.normalize(points - self.c2w[:, None, :, 3], dim=-1)
        return torch.cat([directions - towards, (directions * towards).sum(-1, keepdim=True)], -1)


@dataclass(frozen=True)
class MouthViews(Movable):
    """Crops round a person's mouth.

    Attributes:
        views: the crops.
        lips: positions of the lips in each.
        shape: points of the lips of the mean face, head frame.
        reading: linear map from lip measures and a viewpoint to positions of the lips: I - 1 rows
            of weights, then a bias.
        frames: number of each crop among the training frames.
        measured: positions of the lips in all T training frames; empty after training.
    """

    views: ReferenceViews
    lips: Float[Tensor, "P Q 2"]
    shape: Float[Tensor, "Q 3"]
    reading: Float[Tensor, "I Q2"]
    frames: Int[Tensor, " P"]
    measured: Float[Tensor, "T Q 2"]
