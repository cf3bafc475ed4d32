"""Marching rays through the occupancy grid: ragged samples, packed into one list.

R rays, S candidate steps a ray, M kept samples (M << R * S), K candidates inside the box.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
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
    """Where along rays to search for occupied cells.

    Attributes:
        jitter: 0..1, shifts the samples of each ray by that part of a step; None is 0.5.
        between: first and last distance to search along each ray; None for the whole grid.
    """

    jitter: Float[Tensor, " R"] | None = None
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


def candidates(
    rays: Rays, grid: OccupancyGrid, step: float, search: Search
) -> tuple[Float[Tensor, "R S"], Bool[Tensor, "R S"]]:
    """Distances along each ray, a step apart, and which of them are searched inside the grid's box.

    They begin a whole number of steps from the camera, so the positions of samples depend neither
    on the box nor on the search.
    """
    enter, leave = box_interval(rays.origins, rays.directions, *grid.bounds())
    if search.between is not None:
        # Samples right at both ends count, however they are rounded.
        enter = torch.maximum(enter, search.between[0] - step / 4)
        leave = torch.minimum(leave, search.between[1] + step / 4)
    enter = (enter / step).floor() * step
    span = (leave - enter).amax().clamp_min(0) if len(enter) else enter.new_zeros(())
    steps = torch.arange(int(torch.ceil(span / step).item()), device=enter.device)
    jitter = 0.5 if search.jitter is None else search.jitter[:, None]
    distance = enter[:, None] + (steps + jitter) * step
    return distance, distance < leave[:, None]


def march(
    rays: Rays, grid: OccupancyGrid, config: MarchConfig, search: Search | None = None
) -> PackedSamples:
    """Samples at a fixed step inside occupied cells.

    Args:
        rays: head frame.
        grid: which cells to keep.
        config: step and the largest number of samples a ray.
        search: where along the rays to search.
    """
    count = rays.origins.shape[0]
    along, searched = candidates(rays, grid, config.step, search or Search())
    ray, step = searched.nonzero(as_tuple=True)
    distance = along[ray, step]
    points = rays.origins[ray] + distance[:, None] * rays.directions[ray]
    flat, inside = grid.cell(points)
    kept = (inside & grid.occupied.view(-1)[flat]).nonzero()[:, 0]
    kept, slot = first_of_each(kept, ray[kept], count, config.max_samples)
    return PackedSamples(
        points=points[kept],
        ray=ray[kept],
        slot=slot,
        distance=distance[kept],
        slots=int(slot.max().item()) + 1 if slot.numel() else 1,
        rays=count,
    )


def first_of_each(
    kept: Int[Tensor, " K"], ray: Int[Tensor, " K"], rays: int, most: int
) -> tuple[Int[Tensor, " M"], Int[Tensor, " M"]]:
    """The first `most` candidates of each ray, and how many each has before it on its ray.

    Args:
        kept: candidates.
        ray: rising, the ray of each.
        rays: R.
        most: samples a ray.
    """
    begins = torch.searchsorted(ray, torch.arange(rays, device=ray.device))
    slot = torch.arange(len(kept), device=ray.device) - begins[ray]
    few = (slot < most).nonzero()[:, 0]
    return kept[few], slot[few]
