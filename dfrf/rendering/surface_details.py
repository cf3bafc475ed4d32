"""Detail of a surface, read from the references without the field's networks (deferred shading).

The field's results change slowly over a smooth surface: where to read each reference, and how much
each counts. The images of the references change fast. So the field is evaluated at a few points,
and the images are read at all.

M points of one frame, n whole references, m views of the mouth. The anchors of a point are
K = 3 n + m numbers: its offset from its projection in each reference (column and row, pixels), the
blend weights of the references, and those of the views of the mouth, 0 away from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf import device as devices
from dfrf.field import mouth_pixels
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.field import blend_at
from dfrf.field.reference_encoder import COLOUR
from dfrf.field.reference_maps import ReferenceMaps

MIN_WEIGHT = 1e-6  # sum of blend weights


def blend(
    maps: ReferenceMaps, positions: Float[Tensor, "n M 2"], weights: Float[Tensor, "M n"]
) -> Float[Tensor, "M 3"]:
    """Colours that the views show at positions, in a weighted mean."""
    weights = weights / weights.sum(1, keepdim=True).clamp_min(MIN_WEIGHT)
    colours = maps.read_bilinear(positions)[..., COLOUR].float()
    return (weights.T[..., None] * colours).sum(0)


@dataclass(frozen=True)
class Shading:
    """Findings of a field about points of a surface.

    Attributes:
        positions: where each of V = n + m views shows them, pixels.
        shares: of their colour that come from each view; the rest is the field's own.
        own: colour of the field's own, times its share.
    """

    positions: Float[Tensor, "V M 2"]
    shares: Float[Tensor, "V M"]
    own: Float[Tensor, "M 3"]


@dataclass(frozen=True)
class SurfaceDetails:
    """The references of one frame, read without the field's networks.

    Attributes:
        field: of one frame, from the viewpoint of its camera.
        maps: its references.
    """

    field: ConditionedField
    maps: ReferenceMaps

    @classmethod
    def of(cls, field: object) -> Self | None:
        """Details of a field with references; None for a field without."""
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
        """Anchors of points of a surface, seen along unit directions."""
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
        conditioning, maps, field = self.field.conditioning, self.maps, self.field.field
        frame = torch.zeros(len(points), dtype=torch.long, device=points.device)
        query = field.query(points, directions, frame, conditioning)
        positions, _ = field.locate(query, maps, conditioning, self.field.warp)
        _, _, weights = field.aggregate(query, maps, conditioning, positions)
        moved = (positions - maps.views.project(points)).movedim(0, 1).flatten(1)
        of_mouths = points.new_zeros(len(points), self.counts[1])
        near = mouth_pixels.share(self.maps, points).nonzero()[:, 0]
        if len(near):
            chosen = maps.chosen[0]
            _, _, mouth_weights = field.sample_mouths(query.only(near), chosen, conditioning)
            of_mouths[near] = mouth_weights.T.float()
        return torch.cat([moved, weights.T.float(), of_mouths], 1)

    def shade(self, points: Float[Tensor, "M 3"], directions: Float[Tensor, "M 3"]) -> Shading:
        """Findings of the field about points of a surface, seen along unit directions."""
        size, count = devices.chunk_size(points.device), len(points)
        padding = devices.padding(count) if count else devices.PADDED_MULTIPLE
        places, towards = (
            F.pad(x, (0, 0, 0, padding), value=1.0).split(size) for x in (points, directions)
        )
        with devices.arithmetic(points.device):
            parts = [self._shade(*some) for some in zip(places, towards, strict=True)]
        return Shading(
            torch.cat([part.positions for part in parts], 1)[:, :count],
            torch.cat([part.shares for part in parts], 1)[:, :count],
            torch.cat([part.own for part in parts])[:count],
        )

    def _shade(self, points: Float[Tensor, "M 3"], directions: Float[Tensor, "M 3"]) -> Shading:
        conditioning, maps, field = self.field.conditioning, self.maps, self.field.field
        frame = torch.zeros(len(points), dtype=torch.long, device=points.device)
        query = field.query(points, directions, frame, conditioning)
        positions, offset = field.locate(query, maps, conditioning, self.field.warp)
        features, colour, weights = field.aggregate(query, maps, conditioning, positions)
        fused = features, colour, offset
        if maps.chosen:
            mouths, share = maps.chosen[0], mouth_pixels.share(maps, points)
            in_mouths = mouths.maps.views.project(points) + mouth_pixels.moved(mouths, points)
            of_mouths = weights.new_zeros(len(in_mouths), len(points))
            near = share.nonzero()[:, 0]
            if len(near):
                mouth = field.aggregate(
                    query.only(near), mouths.maps, conditioning, in_mouths[:, near]
                )
                fused = blend_at(fused, mouth, near, share[near, None])
                of_mouths[:, near] = mouth[2].float()
            positions = torch.cat([positions, in_mouths])
            weights = torch.cat([weights * (1 - share), of_mouths * share])
        nearness = mouth_pixels.nearness(maps, points)
        _, own, gate = field.radiance(query, conditioning, fused[0], nearness)
        return Shading(positions, weights * gate.T, (1 - gate) * own)

    def colours(
        self, points: Float[Tensor, "M 3"], anchors: Float[Tensor, "M K"]
    ) -> Float[Tensor, "M 3"]:
        """Colours that the references show of points with these anchors."""
        n, m = self.counts
        moved, weights, of_mouths = anchors.split([2 * n, n, m], 1)
        moved = moved.view(-1, n, 2).movedim(1, 0)
        colours = blend(self.maps, self.maps.views.project(points) + moved, weights)
        share = mouth_pixels.share(self.maps, points)
        near = share.nonzero()[:, 0]
        if len(near):
            mouths, some = self.maps.chosen[0], points[near]
            positions = mouths.maps.views.project(some) + mouth_pixels.moved(mouths, some)
            mouth = blend(mouths.maps, positions, of_mouths[near])
            colours = colours.index_add(0, near, share[near, None] * (mouth - colours[near]))
        return colours
