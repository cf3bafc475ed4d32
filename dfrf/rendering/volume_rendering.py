"""Volume rendering of rays through the occupancy grid.

R rays, M packed samples, S slots a ray, N references.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf import device as devices
from dfrf.field.model import FieldOutput, Model
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.ray_marching import PackedSamples, march

SLAB = 2  # slots evaluated before looking again which rays are opaque
OPAQUE = 5.0  # optical thickness


@dataclass(frozen=True)
class RayColours:
    """What the rays see.

    Attributes:
        colour: (R, 3) premultiplied: sum of w_i c_i, without the background.
        opacity: (R,) sum of w_i.
        depth: (R,) sum of w_i t_i.
        weights, distances: (R, S) dense, zero where a ray has no sample.
        alpha: (M,) opacity of each sample.
        offset: (N, M, 2) warp of each sample, pixels at 512; empty where no gradient is wanted.
        samples: the packed samples.
    """

    colour: Tensor
    opacity: Tensor
    depth: Tensor
    weights: Tensor
    distances: Tensor
    alpha: Tensor
    offset: Tensor
    samples: PackedSamples


def evaluate(
    model: Model,
    samples: PackedSamples,
    directions: Tensor,
    frame: Tensor,
    codes: Tensor,
    maps: ReferenceMaps | None,
    warp: bool,
) -> FieldOutput:
    """The field at packed samples, in chunks that fit the cache."""
    device = samples.points.device
    size = devices.chunk_size(device)
    count = samples.points.shape[0]
    fill = devices.fill(count) if count else devices.ROUND
    points = F.pad(samples.points, (0, 0, 0, fill))
    rays = F.pad(samples.ray, (0, fill))
    parts = []
    with devices.arithmetic(device):
        for some, ray in zip(points.split(size), rays.split(size), strict=True):
            parts.append(model.field(some, directions[ray], frame[ray], codes, maps, warp))
    return FieldOutput(
        torch.cat([p.density for p in parts])[:count],
        torch.cat([p.colour for p in parts])[:count],
        torch.cat([p.offset for p in parts], 1)[:, :count],
    )


def evaluate_until_opaque(
    model: Model,
    samples: PackedSamples,
    directions: Tensor,
    frame: Tensor,
    codes: Tensor,
    maps: ReferenceMaps | None,
    warp: bool,
) -> FieldOutput:
    """The same front to back, a few slots at a time: samples that no light reaches are left at 0.

    At most exp(-OPAQUE) of a ray's light is lost.
    """
    density = samples.points.new_zeros(samples.points.shape[0])
    colour = torch.zeros_like(samples.points)
    thickness = density.new_zeros(samples.rays)
    for first in range(0, samples.slots, SLAB):
        reached = (samples.slot >= first) & (samples.slot < first + SLAB)
        reached &= thickness[samples.ray] < OPAQUE
        pick = torch.nonzero(reached).view(-1)
        part = replace(samples, points=samples.points[pick], ray=samples.ray[pick])
        out = evaluate(model, part, directions, frame, codes, maps, warp)
        density[pick] = out.density
        colour[pick] = out.colour
        thickness.index_add_(0, part.ray, out.density * model.config.march.step)
    return FieldOutput(density, colour, colour.new_zeros(0, 0, 2))


def render_rays(
    model: Model,
    origins: Tensor,
    directions: Tensor,
    frame: Tensor,
    codes: Tensor,
    maps: ReferenceMaps | None,
    *,
    jitter: Tensor | None = None,
    warp: bool = True,
    group: int = 1,
    between: tuple[Tensor, Tensor] | None = None,
) -> RayColours:
    """Volume rendering, equation (8), of rays (R, 3) through occupied cells.

    Args:
        origins, directions: (R, 3) head frame, directions of unit length.
        frame: (R,) index into codes.
        codes: (F, A) what the field is told of each frame.
        maps: reference features, or None. All rays look at those nearest to the middle of their
            origins.
        jitter: (R,) in 0..1 shifts the samples of a ray by part of a step.
        warp: False in the coarse stage.
        group, between: neighbours in turn, and how far to look along each; see `march`.
    """
    if maps is not None:
        maps = maps.near(origins.mean(0), model.config.field.references)
    samples = march(origins, directions, model.grid, model.config.march, jitter, group, between)
    look = evaluate if torch.is_grad_enabled() else evaluate_until_opaque
    out = look(model, samples, directions, frame, codes, maps, warp)
    thickness = out.density * model.config.march.step
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
