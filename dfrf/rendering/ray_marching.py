"""Marching rays through the occupancy grid: ragged samples, packed into one list.

R rays, S candidate steps a ray, M kept samples (M << R * S). A group is a few neighbouring rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.config import MarchConfig
from dfrf.rendering.occupancy import OccupancyGrid


@dataclass(frozen=True)
class PackedSamples:
    """Kept samples, nearest first within each ray.

    Attributes:
        points: (M, 3) head frame.
        ray: (M,) index of the ray of each sample.
        slot: (M,) position of the sample on its ray, 0..slots-1.
        distance: (M,) along the unit direction of the ray, head units.
        slots: the largest number of samples on one ray.
        rays: R.
    """

    points: Tensor
    ray: Tensor
    slot: Tensor
    distance: Tensor
    slots: int
    rays: int

    def dense(self, values: Tensor) -> Tensor:
        """Scatters packed values (M, ...) to (R, slots, ...), zero where there is no sample."""
        out = values.new_zeros((self.rays * self.slots, *values.shape[1:]))
        return out.index_copy(0, self.place, values).view(self.rays, self.slots, *values.shape[1:])

    def total(self, weights: Tensor, values: Tensor) -> Tensor:
        """Weighted sum along each ray, (R, K), of packed values (M, K), with dense weights (R, S).

        Number by number, as most slots hold no sample.
        """
        weighted = weights.view(-1)[self.place, None] * values
        empty = values.new_zeros(self.rays)
        return torch.stack([empty.index_add(0, self.ray, v) for v in weighted.unbind(1)], 1)

    @property
    def place(self) -> Tensor:
        """Where the samples (M,) lie in a dense tensor whose first two dimensions are one."""
        return self.ray * self.slots + self.slot


def box_interval(
    origins: Tensor, directions: Tensor, low: Tensor, high: Tensor
) -> tuple[Tensor, Tensor]:
    """Where rays (R, 3) enter and leave an axis-aligned box; enter > leave when they miss it."""
    safe = torch.where(directions.abs() < 1e-9, torch.full_like(directions, 1e-9), directions)
    first = (low - origins) / safe
    second = (high - origins) / safe
    enter = torch.minimum(first, second).amax(-1).clamp_min(0)
    leave = torch.maximum(first, second).amin(-1)
    return enter, leave


def march(
    origins: Tensor,
    directions: Tensor,
    grid: OccupancyGrid,
    config: MarchConfig,
    jitter: Tensor | None = None,
    group: int = 1,
    between: tuple[Tensor, Tensor] | None = None,
) -> PackedSamples:
    """Samples at a fixed step inside occupied cells.

    Args:
        origins, directions: (R, 3) head frame; directions of unit length.
        grid: which cells to keep.
        config: step and the largest number of samples a ray.
        jitter: (R,) in 0..1, shifts the samples of each ray by that part of a step; None is 0.5.
        group: so many rays in turn lie within one cell of their mean everywhere. They are looked
            at one by one only where the mean passes near an open cell: the samples are the same,
            found in a fraction of the time.
        between: from where to where along each ray to look, (R,) and (R,) distances; None for as
            far as the grid reaches. One ray of each group at least has a finite part.
    """
    groups = origins.shape[0] // group
    if jitter is None:
        jitter = origins.new_full((origins.shape[0],), 0.5)
    enter, leave = box_interval(origins, directions, *grid.bounds())
    if between is not None:
        # Samples right at both ends count, however they are rounded.
        enter = torch.maximum(enter, between[0] - config.step / 4)
        leave = torch.minimum(leave, between[1] + config.step / 4)
    # Whole steps from the camera: where samples lie depends neither on the box nor on the group.
    enter = (enter / config.step).floor() * config.step
    starts = enter.view(groups, group)
    enter = starts.amin(1)
    leave = leave.view(groups, group)
    span = (leave.amax(1) - enter).amax().clamp_min(0) if groups else enter.new_zeros(())
    steps = int(torch.ceil(span / config.step).item())
    o, d = origins.view(groups, group, 3), directions.view(groups, group, 3)
    phase = jitter.view(groups, group)
    offsets = torch.arange(steps, device=origins.device, dtype=origins.dtype)
    along = enter[:, None] + (offsets[None] + phase.mean(1)[:, None]) * config.step
    mean = o.mean(1)[:, None] + along[..., None] * d.mean(1)[:, None]
    near = grid.near_open() if group > 1 else grid.occupied
    may = near.view(-1)[grid.cell(mean)[0]] & (along < leave.amax(1)[:, None])
    owner, step = may.nonzero(as_tuple=True)
    distance = enter[owner, None] + (step[:, None] + phase[owner]) * config.step
    points = o[owner] + distance[..., None] * d[owner]
    flat, inside = grid.cell(points)
    keep = inside & grid.occupied.view(-1)[flat] & (distance < leave[owner])
    keep &= distance > starts[owner]
    # How many a ray has kept up to here: what all rays of its place in a group have kept, less what
    # they had before its group began.
    so_far = F.pad(keep.long().cumsum(0), (0, 0, 1, 0))
    begins = torch.searchsorted(owner, torch.arange(groups, device=owner.device))
    slot = so_far[:-1] - so_far[begins[owner]]
    keep &= slot < config.max_samples
    row, member = keep.nonzero(as_tuple=True)
    kept_slot = slot[row, member]
    slots = int(kept_slot.max().item()) + 1 if kept_slot.numel() else 1
    return PackedSamples(
        points=points[row, member],
        ray=owner[row] * group + member,
        slot=kept_slot,
        distance=distance[row, member],
        slots=slots,
        rays=origins.shape[0],
    )
