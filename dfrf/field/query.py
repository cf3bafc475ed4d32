"""A query of a field: points of some frames, and how the face's motion moves them.

M points, F frames in a batch, n reference views.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.field import brow_deformation, eyelid_deformation
from dfrf.field.reference_maps import ReferenceViews


def per_point(values: Float[Tensor, "F K"], belongs: Float[Tensor, "M F"]) -> Float[Tensor, "#M K"]:
    """Values of frames for each point; one row for all where there is one frame.

    A product with `belongs` instead of an index: the gradient of indexing is added up by several
    threads in any order, and training would not be the same twice.
    """
    return values if values.shape[0] == 1 else belongs @ values


@dataclass(frozen=True)
class FieldQuery:
    """Points that the field is evaluated at.

    Attributes:
        points, directions: head frame, directions of unit length.
        encoded: the points where they are at rest.
        belongs: 1 where a point belongs to a frame.
        brows, lids: measures of the brows and of the lids in its frame; one row for all points
            where there is one frame.
        brow_weights: how much brows move it.
        at_eyes: the K points that lids may move.
    """

    points: Float[Tensor, "M 3"]
    directions: Float[Tensor, "M 3"]
    encoded: Float[Tensor, "M E"]
    belongs: Float[Tensor, "M F"]
    brows: Float[Tensor, "#M 2"]
    lids: Float[Tensor, "#M 2"]
    brow_weights: Float[Tensor, "M 2"]
    at_eyes: Int[Tensor, " K"]

    def only(self, at: Int[Tensor, " K"], lids: bool) -> FieldQuery:
        """The points `at`; `lids` says whether lids may move all of them, or none."""

        def rows(values: Tensor) -> Tensor:
            return values if len(values) == 1 else values.index_select(0, at)

        return FieldQuery(
            self.points[at],
            self.directions[at],
            self.encoded[at],
            self.belongs[at],
            rows(self.brows),
            rows(self.lids),
            self.brow_weights[at],
            torch.arange(len(at) if lids else 0, device=at.device),
        )

    def lifts(self, views: ReferenceViews, which: slice) -> Float[Tensor, "n M"]:
        """How much higher than in n of the views the points are, head units."""
        theirs = views.expression[which]
        lift = brow_deformation.lifts(
            self.brow_weights, self.brows - theirs[:, None, brow_deformation.MEASURES]
        )
        eyelid_deformation.add_lifts(
            lift,
            self.points,
            self.at_eyes,
            views.eyes,
            self.lids,
            theirs[:, eyelid_deformation.MEASURES],
        )
        return lift
