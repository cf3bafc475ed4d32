"""Marching rays through the occupancy grid: ragged samples, packed into one list.

R rays, S candidate steps a ray, M kept samples (M << R * S).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from dfrf.config import MarchConfig
from dfrf.occupancy import OccupancyGrid


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
        index = self.ray * self.slots + self.slot
        return out.index_copy(0, index, values).view(self.rays, self.slots, *values.shape[1:])


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
) -> PackedSamples:
    """Samples at a fixed step inside occupied cells.

    Args:
        origins, directions: (R, 3) head frame; directions of unit length.
        grid: which cells to keep.
        config: step and the largest number of samples a ray.
        jitter: (R,) in 0..1, shifts the samples of each ray by that part of a step; None is 0.5.
    """
    rays = origins.shape[0]
    enter, leave = box_interval(origins, directions, *grid.bounds())
    span = (leave - enter).amax().clamp_min(0) if rays else enter.new_zeros(())
    steps = int(torch.ceil(span / config.step).item())
    phase = jitter if jitter is not None else torch.full_like(enter, 0.5)
    offsets = torch.arange(steps, device=origins.device, dtype=origins.dtype)
    distance = enter[:, None] + (offsets[None] + phase[:, None]) * config.step
    points = origins[:, None] + distance[..., None] * directions[:, None]
    flat, inside = grid.cell(points)
    keep = inside & grid.occupied.view(-1)[flat] & (distance < leave[:, None])
    slot = keep.cumsum(-1) - 1
    keep &= slot < config.max_samples
    ray, step = keep.nonzero(as_tuple=True)
    kept_slot = slot[ray, step]
    slots = int(kept_slot.max().item()) + 1 if kept_slot.numel() else 1
    return PackedSamples(
        points=points[ray, step],
        ray=ray,
        slot=kept_slot,
        distance=distance[ray, step],
        slots=slots,
        rays=rays,
    )
