"""Volume rendering, equation (8), of rays through the occupancy grid.

R rays, M packed samples, S slots a ray, N references.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf import device as devices
from dfrf.cameras import Rays
from dfrf.config import MarchConfig
from dfrf.field.field import FieldOutput
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import PackedSamples, Search, march

SLAB = 2  # slots evaluated between two checks for opaque rays
OPAQUE = 5.0  # optical thickness


class PointField(Protocol):
    """Colour and density at points: all that a renderer needs."""

    def __call__(
        self,
        points: Float[Tensor, "M 3"],
        directions: Float[Tensor, "M 3"],
        frame: Int[Tensor, " M"],
    ) -> FieldOutput:
        """The field at points seen along unit directions, each in the frame of that index."""


class ViewField(Protocol):
    """A field that depends on the viewpoint: it has nearest references."""

    def seen_from(self, origin: Float[Tensor, 3]) -> PointField:
        """The field from a viewpoint, head frame."""


@dataclass(frozen=True)
class Volume:
    """A field and an occupancy grid that rays are sent through.

    Attributes:
        field: colour and density.
        grid: occupied cells.
        march: how rays are sampled.
    """

    field: ViewField
    grid: OccupancyGrid
    march: MarchConfig


@dataclass(frozen=True)
class SeenRays:
    """Rays, as they see the head.

    Attributes:
        colour: premultiplied: sum of w_i c_i, without the background.
        opacity: sum of w_i.
        depth: sum of w_i t_i.
    """

    colour: Float[Tensor, "R 3"]
    opacity: Float[Tensor, " R"]
    depth: Float[Tensor, " R"]


@dataclass(frozen=True)
class RayColours(SeenRays):
    """Rendered rays.

    Attributes:
        weights, distances: zero where a ray has no sample.
        alpha: opacity of each sample.
        offset: warp of each sample, pixels at 512; empty where no gradient is wanted.
        samples: the packed samples.
    """

    weights: Float[Tensor, "R S"]
    distances: Float[Tensor, "R S"]
    alpha: Float[Tensor, " M"]
    offset: Float[Tensor, "N M 2"]
    samples: PackedSamples

    def over(self, background: Float[Tensor, "R 3"]) -> Float[Tensor, "R 3"]:
        """The colour in front of a background."""
        return self.colour + (1 - self.opacity[:, None]) * background


def evaluate(field: PointField, samples: PackedSamples, rays: Rays) -> FieldOutput:
    """The field at packed samples, in chunks that fit the cache."""
    device = samples.points.device
    size = devices.chunk_size(device)
    count = samples.points.shape[0]
    padding = devices.padding(count) if count else devices.PADDED_MULTIPLE
    points = F.pad(samples.points, (0, 0, 0, padding))
    owner = F.pad(samples.ray, (0, padding))
    parts = []
    with devices.arithmetic(device):
        for some, ray in zip(points.split(size), owner.split(size), strict=True):
            parts.append(field(some, rays.directions[ray], rays.frame[ray]))
    return FieldOutput(
        torch.cat([p.density for p in parts])[:count],
        torch.cat([p.colour for p in parts])[:count],
        torch.cat([p.offset for p in parts], 1)[:, :count],
    )


def density_at(
    field: PointField, points: Float[Tensor, "M 3"], origin: Float[Tensor, 3]
) -> Float[Tensor, " M"]:
    """Density of single points, seen from a viewpoint."""
    count = len(points)
    zero = torch.zeros(count, dtype=torch.long, device=points.device)
    rays = Rays(origin.expand(count, 3), F.normalize(points - origin, dim=-1), zero)
    ray = torch.arange(count, device=points.device)
    samples = PackedSamples(points, ray, zero, points.new_zeros(count), 1, count)
    return evaluate(field, samples, rays).density


def evaluate_until_opaque(
    field: PointField, samples: PackedSamples, rays: Rays, step: float
) -> FieldOutput:
    """The field at packed samples, front to back: samples that no light reaches stay at 0.

    At most exp(-OPAQUE) of a ray's light is lost.

    Args:
        step: length of a sample, head units.
    """
    density = samples.points.new_zeros(samples.points.shape[0])
    colour = torch.zeros_like(samples.points)
    thickness = density.new_zeros(samples.rays)
    for first in range(0, samples.slots, SLAB):
        reached = (samples.slot >= first) & (samples.slot < first + SLAB)
        reached &= thickness[samples.ray] < OPAQUE
        pick = torch.nonzero(reached).view(-1)
        part = samples.only(pick)
        out = evaluate(field, part, rays)
        density[pick] = out.density
        colour[pick] = out.colour
        thickness.index_add_(0, part.ray, out.density * step)
    return FieldOutput(density, colour, colour.new_zeros(0, len(colour), 2))


def render_rays(volume: Volume, rays: Rays, search: Search | None = None) -> RayColours:
    """Equation (8) along rays, through occupied cells.

    All rays see the field from the mean of their origins.

    Args:
        volume: field and grid.
        rays: head frame.
        search: where along each ray to search; everywhere when None.
    """
    field, step = volume.field.seen_from(rays.origins.mean(0)), volume.march.step
    samples = march(rays, volume.grid, volume.march, search)
    if torch.is_grad_enabled():
        out = evaluate(field, samples, rays)
    else:
        out = evaluate_until_opaque(field, samples, rays, step)
    # Equation (8): C = sum_i T_i alpha_i c_i, T_i = exp(-sum_{j<i} sigma_j step).
    thickness = out.density * step
    alpha = -torch.expm1(-thickness)
    before = samples.dense(thickness).cumsum(-1)
    weights = torch.exp(-F.pad(before[:, :-1], (1, 0))) * samples.dense(alpha)
    distances = samples.dense(samples.distance)
    return RayColours(
        colour=samples.total(weights, out.colour),
        opacity=weights.sum(-1),
        depth=(weights * distances).sum(-1),
        weights=weights,
        distances=distances,
        alpha=alpha,
        offset=out.offset,
        samples=samples,
    )
