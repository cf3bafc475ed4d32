"""The detail that references show of a surface, without the field.

What a field finds out about points changes slowly over a smooth surface: beside which pixels of the
references to look, and how much each reference counts. The pictures that it looks up change fast.
So the field is evaluated at a few points, and the pictures are read for all (deferred shading).

M points of one frame, n whole references, m views of the mouth. The anchors of a point are
K = 3 n + m numbers: how far beside its projection each reference shows it (column and row, pixels),
the blend weights of the references, and those of the views of the mouth, 0 away from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf import device as devices
from dfrf.field import mouth_pixels
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.reference_encoder import COLOUR
from dfrf.field.reference_maps import ReferenceMaps

LEAST = 1e-6  # sum of blend weights


def blend(
    maps: ReferenceMaps, positions: Float[Tensor, "n M 2"], weights: Float[Tensor, "M n"]
) -> Float[Tensor, "M 3"]:
    """Colours that the views show at positions, in a weighted mean."""
    weights = weights / weights.sum(1, keepdim=True).clamp_min(LEAST)
    colours = maps.read_bilinear(positions)[..., COLOUR].float()
    return (weights.T[..., None] * colours).sum(0)


@dataclass(frozen=True)
class SurfaceDetails:
    """The references of one frame, looked up without the field's networks.

    Attributes:
        field: of one frame, as it is seen from its camera.
        maps: its references.
    """

    field: ConditionedField
    maps: ReferenceMaps

    @classmethod
    def of(cls, field: object) -> Self | None:
        """Those of a field that has references; None for another."""
        if isinstance(field, ConditionedField) and field.maps is not None:
            return cls(field, field.maps)
        return None

    @property
    def counts(self) -> tuple[int, int]:
        """n and m."""
        mouths = len(self.maps.chosen[0].maps.number) if self.maps.chosen else 0
        return len(self.maps.number), mouths

    @property
    def anchor_count(self) -> int:
        """K."""
        return 3 * self.counts[0] + self.counts[1]

    def anchors(
        self, points: Float[Tensor, "M 3"], directions: Float[Tensor, "M 3"]
    ) -> Float[Tensor, "M K"]:
        """What the field finds out about points of a surface, seen along unit directions."""
        size = devices.chunk_size(points.device)
        with devices.arithmetic(points.device):
            parts = [
                self._anchors(*some)
                for some in zip(points.split(size), directions.split(size), strict=True)
            ]
        return torch.cat(parts)

    def _anchors(
        self, points: Float[Tensor, "M 3"], directions: Float[Tensor, "M 3"]
    ) -> Float[Tensor, "M K"]:
        known, maps, field = self.field.conditioning, self.maps, self.field.field
        frame = torch.zeros(len(points), dtype=torch.long, device=points.device)
        query = field.query(points, directions, frame, known)
        positions, _ = field.locate(query, maps, known, self.field.warp)
        _, _, weights = field.aggregate(query, maps, known, positions)
        moved = (positions - maps.views.project(points)).movedim(0, 1).flatten(1)
        of_mouths = points.new_zeros(len(points), self.counts[1])
        near = mouth_pixels.share(self.maps, points).nonzero()[:, 0]
        if len(near):
            _, _, theirs = field.sample_mouths(query.only(near), maps.chosen[0], known)
            of_mouths[near] = theirs.T.float()
        return torch.cat([moved, weights.T.float(), of_mouths], 1)

    def colours(
        self, points: Float[Tensor, "M 3"], anchors: Float[Tensor, "M K"]
    ) -> Float[Tensor, "M 3"]:
        """What the references show of points with these anchors."""
        n, m = self.counts
        moved, weights, of_mouths = anchors.split([2 * n, n, m], 1)
        moved = moved.view(-1, n, 2).movedim(1, 0)
        seen = blend(self.maps, self.maps.views.project(points) + moved, weights)
        share = mouth_pixels.share(self.maps, points)
        near = share.nonzero()[:, 0]
        if len(near):
            mouths, some = self.maps.chosen[0], points[near]
            positions = mouths.maps.views.project(some) + mouth_pixels.moved(mouths, some)
            mouth = blend(mouths.maps, positions, of_mouths[near])
            seen = seen.index_add(0, near, share[near, None] * (mouth - seen[near]))
        return seen
