"""Views of a person's mouth: of many learned frames, those with the lips that are wanted.

A few whole references show few mouths. So crops round the mouths of frames that stand for all lips
are kept beside them, and points near the lips look at those of a like mouth in a like pose.

P crops, L lip measures.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from dfrf.field import brow_deformation
from dfrf.field.reference_maps import LEAST_WEIGHT, ReferenceMaps, ReferenceViews

VIEWS = 4  # that a point looks at
TURN = 0.15  # rad that count as much as lips apart by the spread of each measure
FADE = 2  # power by which a view's weight falls with its distance
EDGE = 0.7  # of the region's radii, from where its weight falls to nothing
NEIGHBOURS = 10  # frames to each side of one that is learned, which show nearly the same


@dataclass(frozen=True)
class MouthViews:
    """Crops round a person's mouth.

    Attributes:
        views: the crops.
        lips: what is read off the codes of their frames.
        frames: their numbers among the learned ones.
        region: middle of the mouth, and how far it reaches from there, head units.
    """

    views: ReferenceViews
    lips: Float[Tensor, "P L"]
    frames: Int[Tensor, " P"]
    region: Float[Tensor, "2 3"]

    def to(self, device: torch.device) -> MouthViews:
        """The same on a device."""
        return MouthViews(
            self.views.to(device),
            self.lips.to(device),
            self.frames.to(device),
            self.region.to(device),
        )

    def share(self, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
        """How much of what is seen of points is read off mouths, 0..1."""
        middle, reach = self.region
        return brow_deformation.ramp(((points - middle) / reach).norm(dim=-1), 1, EDGE)

    def learned_beside(self, frame: Int[Tensor, ""]) -> Bool[Tensor, " P"]:
        """Which of the crops show a frame, or nearly."""
        return (self.frames - frame).abs() <= NEIGHBOURS


def nearest(
    mouths: MouthViews,
    maps: ReferenceMaps,
    lips: Float[Tensor, " L"],
    origin: Float[Tensor, 3],
    barred: Bool[Tensor, " P"] | None = None,
) -> ReferenceMaps:
    """The few crops with the most similar lips and pose; weights fade before another takes over.

    Args:
        mouths: to choose from.
        maps: of all of them.
        lips: wanted, as they are read off codes.
        origin: of the camera, head frame.
        barred: crops that must not be looked at.
    """
    spread = mouths.lips.std(0).clamp_min(LEAST_WEIGHT)
    of_lips = ((mouths.lips - lips) / spread).square().mean(-1)
    seen_from = F.normalize(mouths.views.c2w[:, :, 3], dim=-1)
    turned = (seen_from - F.normalize(origin, dim=0)).square().sum(-1) / TURN**2
    apart = (of_lips + turned).sqrt()
    if barred is not None:
        apart = apart.masked_fill(barred, torch.inf)
    apart, chosen = apart.topk(min(VIEWS + 1, len(apart)), largest=False)
    weight = 1 - (apart[:-1] / apart[-1].clamp_min(LEAST_WEIGHT)).nan_to_num(1.0) ** FADE
    return replace(maps.only(chosen[:-1], weight.clamp_min(LEAST_WEIGHT).log()), mouths=None)
