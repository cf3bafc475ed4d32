"""Marching rays through the occupancy grid: ragged samples, packed into one list.

R rays, S candidate steps a ray, M kept samples (M << R * S). A group is a few neighbouring rays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from dfrf.cameras import Rays
from dfrf.config import MarchConfig
from dfrf.rendering.occupancy import OccupancyGrid


@dataclass(frozen=True)
class PackedSamples:
    """Kept samples, nearest first within each ray.

    Attributes:
        points: head frame.
        ray: index of the ray of each sample.
        slot: position of the sample on its ray, 0..slots-1.
        distance: along the unit direction of the ray, head units.
        slots: the largest number of samples on one ray.
        rays: R.
    """

    points: Float[Tensor, "M 3"]
    ray: Int[Tensor, " M"]
    slot: Int[Tensor, " M"]
    distance: Float[Tensor, " M"]
    slots: int
    rays: int

    def only(self, pick: Int[Tensor, " K"]) -> PackedSamples:
        """Some of the samples, at the slots where they are."""
        return replace(
            self,
            points=self.points[pick],
            ray=self.ray[pick],
            slot=self.slot[pick],
            distance=self.distance[pick],
        )

    def dense(self, values: Float[Tensor, M * K]) -> Float[Tensor, "R S *K"]:
        """Packed values at their slots, zero where there is no sample."""
        out = values.new_zeros((self.rays * self.slots, *values.shape[1:]))
        return out.index_copy(0, self.place, values).view(self.rays, self.slots, *values.shape[1:])

    def total(
        self, weights: Float[Tensor, "R S"], values: Float[Tensor, "M K"]
    ) -> Float[Tensor, "R K"]:
        """Weighted sum of packed values along each ray, with dense weights.

        Number by number, as most slots hold no sample.
        """
        weighted = weights.view(-1)[self.place, None] * values
        empty = values.new_zeros(self.rays)
        return torch.stack([empty.index_add(0, self.ray, v) for v in weighted.unbind(1)], 1)

    @property
    def place(self) -> Int[Tensor, " M"]:
        """Where the samples lie in a dense tensor whose first two dimensions are one."""
        return self.ray * self.slots + self.slot


@dataclass(frozen=True)
class Search:
    """Where along rays to look for occupied cells.

    Attributes:
        jitter: 0..1, shifts the samples of each ray by that part of a step; None is 0.5.
        group: so many rays in turn lie within one cell of their mean everywhere. They are looked
            at one by one only where the mean passes near an open cell: the samples are the same,
            found in a fraction of the time.
        between: from which to which distance along each ray to look; None for as far as the grid
            reaches. One ray of each group at least has a finite part.
    """

    jitter: Float[Tensor, " R"] | None = None
    group: int = 1
    between: tuple[Float[Tensor, " R"], Float[Tensor, " R"]] | None = None


def box_interval(
    origins: Float[Tensor, "R 3"],
    directions: Float[Tensor, "R 3"],
    low: Float[Tensor, 3],
    high: Float[Tensor, 3],
) -> tuple[Float[Tensor, " R"], Float[Tensor, " R"]]:
    """Where rays enter and leave an axis-aligned box; enter > leave when they miss it."""
    safe = torch.where(directions.abs() < 1e-9, torch.full_like(directions, 1e-9), directions)
    first = (low - origins) / safe
    second = (high - origins) / safe
    enter = torch.minimum(first, second).amax(-1).clamp_min(0)
    leave = torch.maximum(first, second).amin(-1)
    return enter, leave


def search_interval(
    rays: Rays, grid: OccupancyGrid, step: float, search: Search
) -> tuple[Float[Tensor, " R"], Float[Tensor, " R"]]:
    """From where to where along each ray to look: inside the grid's box and the search's part.

    The first is a whole number of steps from the camera, so where samples lie depends neither on
    the box nor on the group.
    """
    enter, leave = box_interval(rays.origins, rays.directions, *grid.bounds())
    if search.between is not None:
        # Samples right at both ends count, however they are rounded.
        enter = torch.maximum(enter, search.between[0] - step / 4)
        leave = torch.minimum(leave, search.between[1] + step / 4)
    return (enter / step).floor() * step, leave


def slots_of(
    keep: Bool[Tensor, "K G"], owner: Int[Tensor, " K"], groups: int
) -> Int[Tensor, "K G"]:
    """How many samples each ray has kept before each candidate.

    All that rays of its place in a group have kept so far, less what they had before its group
    began.

    Args:
        keep: whether a candidate step is kept, for each ray of its group.
        owner: rising, the group of each candidate step.
        groups: number of groups.
    """
    so_far = F.pad(keep.long().cumsum(0), (0, 0, 1, 0))
    begins = torch.searchsorted(owner, torch.arange(groups, device=owner.device))
    return so_far[:-1] - so_far[begins[owner]]


def march(
    rays: Rays, grid: OccupancyGrid, config: MarchConfig, search: Search | None = None
) -> PackedSamples:
    """Samples at a fixed step inside occupied cells.

    Args:
        rays: head frame.
        grid: which cells to keep.
        config: step and the largest number of samples a ray.
        search: where along the rays to look.
    """
    search = search or Search()
    group, groups = search.group, rays.origins.shape[0] // search.group
    jitter = search.jitter
    if jitter is None:
        jitter = rays.origins.new_full((rays.origins.shape[0],), 0.5)
    enter, leave = search_interval(rays, grid, config.step, search)
    starts = enter.view(groups, group)
    enter = starts.amin(1)
    leave = leave.view(groups, group)
    span = (leave.amax(1) - enter).amax().clamp_min(0) if groups else enter.new_zeros(())
    steps = int(torch.ceil(span / config.step).item())
    o, d = rays.origins.view(groups, group, 3), rays.directions.view(groups, group, 3)
    phase = jitter.view(groups, group)
    offsets = torch.arange(steps, device=o.device, dtype=o.dtype)
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
    slot = slots_of(keep, owner, groups)
    keep &= slot < config.max_samples
    row, member = keep.nonzero(as_tuple=True)
    kept_slot = slot[row, member]
    return PackedSamples(
        points=points[row, member],
        ray=owner[row] * group + member,
        slot=kept_slot,
        distance=distance[row, member],
        slots=int(kept_slot.max().item()) + 1 if kept_slot.numel() else 1,
        rays=rays.origins.shape[0],
    )
