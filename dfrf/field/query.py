"""A query of a field: points of some frames. M points, F frames in a batch."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float, Int
from torch import Tensor


def per_point(values: Float[Tensor, "F K"], belongs: Float[Tensor, "M F"]) -> Float[Tensor, "#M K"]:
    """Values of frames for each point; one row for all where there is one frame.

    A product with `belongs` instead of an index: several threads would sum the gradient of indexing
    in any order, and training would not be deterministic.
    """
    return values if values.shape[0] == 1 else belongs @ values


@dataclass(frozen=True)
class FieldQuery:
    """Points that the field is evaluated at.

    Attributes:
        points, directions: head frame, directions of unit length.
        encoded: the points as the networks read them.
        belongs: 1 where a point belongs to a frame.
    """

    points: Float[Tensor, "M 3"]
    directions: Float[Tensor, "M 3"]
    encoded: Float[Tensor, "M E"]
    belongs: Float[Tensor, "M F"]

    def only(self, at: Int[Tensor, " K"]) -> FieldQuery:
        """The points `at`."""
        return FieldQuery(self.points[at], self.directions[at], self.encoded[at], self.belongs[at])
