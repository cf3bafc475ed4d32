"""The radiance field of the `fast` preset: equation (7), and the references that feed it.

M points, N references, F frames in a batch, C feature channels, K numbers of conditioning.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor, nn

from dfrf import device as devices
from dfrf.config import FieldConfig
from dfrf.field import mouth_pixels
from dfrf.field.aggregation import Aggregation
from dfrf.field.conditioning import Conditioning
from dfrf.field.encodings import encoded_size, frequency_encoding
from dfrf.field.query import FieldQuery, per_point
from dfrf.field.reference_encoder import COLOUR, MATTE, ReferenceEncoder, shows_head
from dfrf.field.reference_maps import ChosenMouths, ReferenceMaps
from dfrf.field.warp import Warp

# The density's prior: an ellipsoid, head units.
PRIOR_CENTRE = (0.0, 0.1, -0.05)
PRIOR_RADII = (0.85, 1.25, 1.05)
PRIOR_SLOPE = 20.0
PRIOR_SKIN = 0.9  # of the radii
DENSITY_SCALE = 25.0

# F~ of M points, the colour that the references blend to, and the warp of each reference.
Fused = tuple[Float[Tensor, "M O"], Float[Tensor, "M 3"], Float[Tensor, "n M 2"]]
FusedSome = tuple[Float[Tensor, "k O"], Float[Tensor, "k 3"], Tensor]  # of k of them


@dataclass(frozen=True)
class FieldOutput:
    """Density, colour and warp of points.

    Attributes:
        density: per head unit.
        colour: in 0..1.
        offset: warp, pixels at 512 (column, row); zeros without warp, no rows without references.
    """

    density: Float[Tensor, " M"]
    colour: Float[Tensor, "M 3"]
    offset: Float[Tensor, "N M 2"]


def density_prior(points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """Prior added to the raw density: large inside a mean head, negative outside."""
    centre, radii = points.new_tensor(PRIOR_CENTRE), points.new_tensor(PRIOR_RADII)
    return PRIOR_SLOPE * (PRIOR_SKIN - ((points - centre) / radii).norm(dim=-1))


def select_nonzero(
    at: Int[Tensor, " K"], weight: Float[Tensor, " K"]
) -> tuple[Int[Tensor, " k"], Float[Tensor, "k 1"]]:
    """The points `at` with a weight above 0, padded with weight 0 (`device.padding`)."""
    some = weight.nonzero().squeeze(1)
    at, weight = at[some], weight[some, None]
    padding = devices.padding(len(at))
    return torch.cat([at, at[:1].expand(padding)]), F.pad(weight, (0, 0, 0, padding))


def blend_at(
    first: Fused, other: FusedSome, at: Int[Tensor, " k"], weight: Float[Tensor, "k 1"]
) -> Fused:
    """`first` with a share `weight` of `other` blended in at the points `at`; the warp stays."""
    fused, colour, offset = first
    fused = fused.index_add(0, at, (weight * (other[0] - fused[at])).to(fused.dtype))
    return fused, colour.index_add(0, at, weight * (other[1] - colour[at])), offset


class Field(nn.Module):
    """F_theta of equation (7), with everything that feeds it."""

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        self.config = config
        point_dim = encoded_size(config.point_octaves)
        direction_dim = encoded_size(config.direction_octaves)
        width = config.width
        # The parts draw their random weights in this order: another order gives another model.
        self.conditioning = Conditioning(config)
        aggregated = 0
        if config.references:
            self.encoder = ReferenceEncoder(config)
            self.aggregation = Aggregation(config, point_dim)
            aggregated = self.aggregation.out_dim
            if config.use_warp:
                self.warp = Warp(config, point_dim)
        self.input = nn.Linear(point_dim + aggregated, width)
        self.input_conditioning = nn.Linear(config.cond_dim, width, bias=False)
        self.hidden = nn.ModuleList(nn.Linear(width, width) for _ in range(config.depth - 1))
        self.density = nn.Linear(width, 1)
        self.view = nn.Linear(width + direction_dim, 64)
        self.colour = nn.Linear(64, 4)
        nn.init.zeros_(self.density.bias)

    def locate(
        self, query: FieldQuery, maps: ReferenceMaps, conditioning: Float[Tensor, "F K"], warp: bool
    ) -> tuple[Float[Tensor, "n M 2"], Float[Tensor, "n M 2"]]:
        """Equations (1), (3) and (4): positions of points in the n views, pixels, and the warp."""
        projected = maps.views.project(query.points)
        offset = torch.zeros_like(projected)
        if warp and self.config.use_warp:
            at_pixel = maps.read_nearest(projected)
            offset = self.warp(query.encoded, conditioning, query.belongs, at_pixel)
        # Equation (4): (u', v') = (u + du, v + dv), from pixels at 512 to those of the views.
        return projected + offset * maps.views.scale, offset

    def aggregate(
        self,
        query: FieldQuery,
        maps: ReferenceMaps,
        conditioning: Float[Tensor, "F K"],
        positions: Float[Tensor, "n M 2"],
    ) -> tuple[Float[Tensor, "M O"], Float[Tensor, "M 3"], Float[Tensor, "n M"]]:
        """F~ and colour of points read at positions in the n views, and blend weights."""
        feature = maps.read_bilinear(positions)
        towards = maps.views.direction_differences(query.points, query.directions)
        fused, weight = self.aggregation(
            feature,
            towards.to(feature.dtype),
            maps.log_view_weight[:, None] + shows_head(feature[..., MATTE]).log(),
            query.encoded,
            conditioning,
            query.belongs,
        )
        return fused, (weight[..., None] * feature[..., COLOUR].float()).sum(0), weight

    def sample_mouths(
        self, query: FieldQuery, mouths: ChosenMouths, conditioning: Float[Tensor, "F K"]
    ) -> tuple[Float[Tensor, "M O"], Float[Tensor, "M 3"], Float[Tensor, "n M"]]:
        """F~ and colour of points from n mouth views, and blend weights.

        The motion of lips is measured, so it replaces the warp that D_eta predicts.
        """
        points = query.points
        positions = mouths.maps.views.project(points) + mouth_pixels.moved(mouths, points)
        return self.aggregate(query, mouths.maps, conditioning, positions)

    def fuse_references(
        self,
        query: FieldQuery,
        maps: ReferenceMaps,
        conditioning: Float[Tensor, "F K"],
        warp: bool,
        mouth_share: Float[Tensor, " M"],
    ) -> Fused:
        """F~ and colour of points from the references, blended with mouth views by their share."""
        positions, offset = self.locate(query, maps, conditioning, warp)
        features, colour, _ = self.aggregate(query, maps, conditioning, positions)
        fused = features, colour, offset
        near = mouth_share.nonzero().squeeze(1)
        for frame, chosen in enumerate(maps.chosen):
            at, weight = select_nonzero(near, mouth_share[near] * query.belongs[near, frame])
            if len(at):
                mouth = self.sample_mouths(query.only(at), chosen, conditioning)
                fused = blend_at(fused, mouth, at, weight)
        return fused

    def query(
        self,
        points: Float[Tensor, "M 3"],
        directions: Float[Tensor, "M 3"],
        frame: Int[Tensor, " M"],
        conditioning: Float[Tensor, "F K"],
    ) -> FieldQuery:
        """The query of points; arguments as of `forward`."""
        # Rounded once, not at every layer that reads it.
        encoded = frequency_encoding(points, self.config.point_octaves).to(
            devices.matrix_type(points.device)
        )
        belongs = F.one_hot(frame, conditioning.shape[0]).to(conditioning.dtype)
        return FieldQuery(points, directions, encoded, belongs)

    def forward(
        self,
        points: Float[Tensor, "M 3"],
        directions: Float[Tensor, "M 3"],
        frame: Int[Tensor, " M"],
        conditioning: Float[Tensor, "F K"],
        maps: ReferenceMaps | None,
        warp: bool = True,
    ) -> FieldOutput:
        """Density and colour of points seen along unit directions.

        Args:
            points: head frame.
            directions: of unit length.
            frame: index of the frame of each point into the conditioning.
            conditioning: see `Conditioning`.
            maps: references; None for a field without them.
            warp: False in the coarse stage.
        """
        query = self.query(points, directions, frame, conditioning)
        if maps is None:
            density, own, _ = self.radiance(query, conditioning)
            return FieldOutput(density, own, points.new_zeros(0, points.shape[0], 2))
        share = mouth_pixels.share(maps, points)
        fused = self.fuse_references(query, maps, conditioning, warp, share)
        # The field's own colour is blurred: in training that costs less than misplaced teeth. Where
        # lips move further than in training, it turns white beside them. So it is unused there.
        near = mouth_pixels.nearness(maps, points)
        density, own, gate = self.radiance(query, conditioning, fused[0], near)
        return FieldOutput(density, gate * fused[1] + (1 - gate) * own, fused[2])

    def radiance(
        self,
        query: FieldQuery,
        conditioning: Float[Tensor, "F K"],
        fused: Float[Tensor, "M O"] | None = None,
        near: Float[Tensor, " M"] | None = None,
    ) -> tuple[Float[Tensor, " M"], Float[Tensor, "M 3"], Float[Tensor, "M 1"]]:
        """Equation (7): density, the field's own colour, and the share of the references' colour.

        Args:
            query: the points.
            conditioning: see `Conditioning`.
            fused: F~; None for a field without references, whose share is 0.
            near: share of the references' colour that is taken in any case.
        """
        parts = [query.encoded]
        if fused is not None:
            parts.append(fused.to(query.encoded.dtype))
        # Equation (7): colour and density = F_theta(p, d, A, F~).
        h = self.input(torch.cat(parts, -1))
        shared = per_point(self.input_conditioning(conditioning), query.belongs)
        h = F.relu(h.add_(shared), inplace=True)
        for layer in self.hidden:
            h = F.relu(layer(h), inplace=True)
        raw_density = 4 * self.density(h).squeeze(-1).float() + density_prior(query.points)
        density = DENSITY_SCALE * F.softplus(raw_density)
        towards = frequency_encoding(query.directions, self.config.direction_octaves).to(
            query.encoded.dtype
        )
        raw = self.colour(F.relu(self.view(torch.cat([h, towards], -1)), inplace=True)).float()
        own = raw[..., :3].sigmoid()
        if fused is None or near is None:
            return density, own, torch.zeros_like(raw[..., 3:])
        share = torch.lerp((raw[..., 3:] + 2).sigmoid(), raw.new_ones(()), near[:, None])
        return density, own, share
