"""Occupancy grid in head space: the cells in which rays are sampled.

G cells along each axis. A cell holds the largest rendering weight that a sample in it has had
lately. Weights fade, so a cell that no ray confirms closes. Cells next to a heavy one stay open, so
that a surface can move.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from dfrf.config import BOX_HIGH, BOX_LOW

OPEN_WEIGHT = 0.02
FADE = 0.7


class OccupancyGrid(nn.Module):
    """Cells (G, G, G) over the head's box, x, y, z order."""

    low: Float[Tensor, 3]
    high: Float[Tensor, 3]
    weight: Float[Tensor, "G G G"]
    occupied: Bool[Tensor, "G G G"]

    def __init__(self, resolution: int) -> None:
        super().__init__()
        self.resolution = resolution
        shape = (resolution,) * 3
        self.register_buffer("low", torch.tensor(BOX_LOW), persistent=False)
        self.register_buffer("high", torch.tensor(BOX_HIGH), persistent=False)
        self.register_buffer("weight", torch.ones(shape))
        self.register_buffer("occupied", torch.ones(shape, dtype=torch.bool))

    def cell(self, points: Float[Tensor, "*B 3"]) -> tuple[Int[Tensor, "*B"], Bool[Tensor, "*B"]]:
        """Flat index of the cell of each point, and whether it lies in the box."""
        unit = (points - self.low) / (self.high - self.low)
        inside = ((unit >= 0) & (unit < 1)).all(-1)
        i = (unit * self.resolution).long().clamp_(0, self.resolution - 1)
        flat = (i[..., 0] * self.resolution + i[..., 1]) * self.resolution + i[..., 2]
        return flat, inside

    def centres(self) -> Float[Tensor, "C 3"]:
        """Centre of every cell, C = G**3, in the order of the flat index."""
        axis = (torch.arange(self.resolution, device=self.low.device) + 0.5) / self.resolution
        unit = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
        return self.low + unit * (self.high - self.low)

    def open_centres(self) -> Float[Tensor, "c 3"]:
        """Centre of every open cell."""
        unit = (self.occupied.nonzero() + 0.5) / self.resolution
        return self.low + unit * (self.high - self.low)

    def bounds(self) -> tuple[Float[Tensor, 3], Float[Tensor, 3]]:
        """Corners of the box that holds all open cells; the same twice where none is open."""
        low, high = self.low.clone(), self.low.clone()
        cell = (self.high - self.low) / self.resolution
        counts = self.occupied.float()  # sums of floats take a fifth of the time of `any`
        for axis in range(3):
            across = [other for other in range(3) if other != axis]
            open_cells = torch.nonzero(counts.sum(across)).view(-1)
            if open_cells.numel():
                low[axis] += cell[axis] * open_cells[0]
                high[axis] += cell[axis] * (open_cells[-1] + 1)
        return low, high

    @torch.no_grad()
    def start_from(self, keep: Bool[Tensor, "*C"]) -> None:
        """Opens exactly the cells of `keep`, G**3 of them."""
        self.occupied.copy_(keep.reshape(self.occupied.shape))
        self.weight.copy_(self.occupied.float())

    @torch.no_grad()
    def observe(self, points: Float[Tensor, "M 3"], weights: Float[Tensor, " M"]) -> None:
        """Records the rendering weights of samples at `points`."""
        flat, inside = self.cell(points)
        self.weight.view(-1).scatter_reduce_(
            0, flat[inside], weights[inside].float(), reduce="amax"
        )

    @torch.no_grad()
    def refresh(self) -> None:
        """Recomputes which cells are open: the heavy ones and those that share a face with one.

        Then all weights fade, so a cell that no ray confirms closes: the inside of the head, where
        light never comes, as well as the air round it.
        """
        heavy = (self.weight > OPEN_WEIGHT).float()[None, None]
        near = [
            F.max_pool3d(heavy, kernel, stride=1, padding=[k // 2 for k in kernel])
            for kernel in ((3, 1, 1), (1, 3, 1), (1, 1, 3))
        ]
        self.occupied.copy_((near[0] + near[1] + near[2])[0, 0] > 0)
        self.weight *= FADE
