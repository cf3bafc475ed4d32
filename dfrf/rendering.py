"""Rendering through the occupancy grid, for training and for whole frames.

R rays, M packed samples, S slots a ray, N references.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf import device as devices
from dfrf.cameras import pixel_rays
from dfrf.marching import PackedSamples, march
from dfrf.model import FieldOutput, Model
from dfrf.views import ReferenceMaps
from dfrf.workers import Workers

RAYS_AT_ONCE = 16384
FRAMES_AT_ONCE = 8
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
) -> RayColours:
    """Volume rendering, equation (8), of rays (R, 3) through occupied cells.

    Args:
        origins, directions: (R, 3) head frame, directions of unit length.
        frame: (R,) index into codes.
        codes: (F, A) what the field is told of each frame.
        maps: reference features, or None.
        jitter: (R,) in 0..1 shifts the samples of a ray by part of a step.
        warp: False in the coarse stage.
        group: so many rays in turn are neighbours; see `march`.
    """
    samples = march(origins, directions, model.grid, model.config.march, jitter, group)
    look = evaluate if torch.is_grad_enabled() else evaluate_until_opaque
    out = look(model, samples, directions, frame, codes, maps, warp)
    thickness = out.density * model.config.march.step
    alpha = -torch.expm1(-thickness)
    before = samples.dense(thickness).cumsum(-1)
    weights = torch.exp(-F.pad(before[:, :-1], (1, 0))) * samples.dense(alpha)
    distances = samples.dense(samples.distance)
    colour = (weights[..., None] * samples.dense(out.colour)).sum(1)
    return RayColours(
        colour=colour,
        opacity=weights.sum(-1),
        depth=(weights * distances).sum(-1),
        weights=weights,
        distances=distances,
        alpha=alpha,
        offset=out.offset,
        samples=samples,
    )


def tile_side(model: Model, c2w: Tensor, focal: float, size: int) -> int:
    """Side in pixels of the square tiles whose rays stay within one cell of their mean."""
    grid = model.grid
    cell = float(((grid.high - grid.low) / grid.resolution).min())
    far = float((c2w[:, 3] - (grid.low + grid.high) / 2).norm() + (grid.high - grid.low).norm() / 2)
    for side in (8, 4, 2):
        if size % side == 0 and (side - 1) / 2**0.5 * far / focal <= cell:
            return side
    return 1


def head_tiles(
    model: Model, c2w: Tensor, focal: float, centre: Tensor, size: int, side: int
) -> Tensor:
    """Pixels (P, side * side) (row-major) of the tiles that open cells can cover in a frame.

    Every open cell is splatted as a disc that covers its projection, so no ray that would meet an
    open cell is left out.
    """
    grid = model.grid
    centres = grid.centres()[grid.occupied.view(-1)]
    local = (centres - c2w[:, 3]) @ c2w[:, :3]
    depth = -local[:, 2]
    column = centre[0] + focal * local[:, 0] / depth
    row = centre[1] - focal * local[:, 1] / depth
    cell = ((grid.high - grid.low) / grid.resolution).norm() / 2
    radius = int(torch.ceil(focal * cell / depth.min()).item()) + 1 if depth.numel() else 0
    mask = torch.zeros(size, size, device=c2w.device)
    inside = (column > -radius) & (column < size + radius) & (row > -radius) & (row < size + radius)
    mask[
        row[inside].round().long().clamp(0, size - 1),
        column[inside].round().long().clamp(0, size - 1),
    ] = 1
    wide, tall = (1, 2 * radius + 1), (2 * radius + 1, 1)
    grown = F.max_pool2d(mask[None, None], wide, stride=1, padding=(0, radius))
    grown = F.max_pool2d(grown, tall, stride=1, padding=(radius, 0))
    row, column = torch.nonzero(F.max_pool2d(grown, side)[0, 0] > 0).unbind(-1)
    within = torch.arange(side, device=c2w.device)
    first = row * side * size + column * side
    return first[:, None] + (within[:, None] * size + within).view(-1)


@torch.no_grad()
def render_frame(
    model: Model,
    c2w: Tensor,
    focal: float,
    centre: Tensor,
    told: Tensor,
    maps: ReferenceMaps | None,
    size: int,
) -> tuple[Tensor, Tensor]:
    """The head of one frame; as `render_frames`, with c2w (3, 4), centre (2,), told (told_dim,)."""
    side = tile_side(model, c2w, focal, size)
    tiles = head_tiles(model, c2w, focal, centre, size, side)
    colour = torch.zeros(size * size, 3, device=c2w.device)
    opacity = torch.zeros(size * size, device=c2w.device)
    for part in tiles.view(-1).split(RAYS_AT_ONCE):
        count = part.numel()
        position = torch.stack([part % size, part // size], -1).float()
        origins, directions = pixel_rays(
            c2w.expand(count, 3, 4), focal, centre.expand(count, 2), position
        )
        seen = render_rays(
            model,
            origins,
            F.normalize(directions, dim=-1),
            torch.zeros_like(part),
            told[None],
            maps,
            group=side * side,
        )
        colour[part] = seen.colour
        opacity[part] = seen.opacity
    return colour.view(size, size, 3), opacity.view(size, size)


def render_frames(
    model: Model,
    c2w: Tensor,
    focal: float,
    centres: Tensor,
    windows: Tensor,
    upper: Tensor,
    maps: ReferenceMaps | None,
    size: int,
) -> Iterator[tuple[Tensor, Tensor]]:
    """Heads of frames, in their order, on a CPU as many at once as there are cores.

    Args:
        c2w: (T, 3, 4); focal in pixels; centres (T, 2).
        windows: (T + 2 REACH, 8, 16, D) speech windows of each frame's neighbours.
        upper: (T, U) measures of the upper face.
        maps: reference features.
        size: side of the square picture.

    Yields:
        Premultiplied colour (size, size, 3) in 0..1 and opacity (size, size).
    """
    model.eval()
    with torch.no_grad():
        told = model.field.told(windows, upper)

    def one(t: int) -> tuple[Tensor, Tensor]:
        return render_frame(model, c2w[t], focal, centres[t], told[t], maps, size)

    with Workers(c2w.device, FRAMES_AT_ONCE) as workers:
        yield from workers.map(one, range(c2w.shape[0]))
