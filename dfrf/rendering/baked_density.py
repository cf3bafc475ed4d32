"""The density of a learned head on a lattice: looked up where marching asks a network.

Before `softplus`, density changes so smoothly that it can be interpolated between lattice points.
What changes it from frame to frame, lips, upper face and viewpoint, changes it nearly linearly.

V lattice points, G cells along an axis, D numbers that describe a frame, R rays, S samples a ray.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from dfrf.cameras import Rays
from dfrf.field.field import DENSITY_SCALE
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import Search, search_interval
from dfrf.rendering.volume_rendering import PointField

# Before softplus. A sample below is transparent, one above is opaque.
EMPTY, SOLID = -8.0, 4.0
FRAMES = 64
RIDGE = 1.0  # frames' worth
RAYS_AT_ONCE = 4096  # samples stay in the cache


@dataclass(frozen=True)
class Sight:
    """The first surface that rays meet.

    Attributes:
        opacity: sum of the weights.
        depth: mean distance where light comes from; of no meaning where opacity is 0.
    """

    opacity: Float[Tensor, " R"]
    depth: Float[Tensor, " R"]


@dataclass(frozen=True)
class DensityOfFrame:
    """The density of one frame.

    Attributes:
        grid: its box; nothing is outside of its open cells' bounds.
        raw: before softplus, at lattice points.
    """

    grid: OccupancyGrid
    raw: Float[Tensor, "g g g"]

    def __call__(self, points: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B"]:
        """Density of points."""
        unit = (points - self.grid.low) / (self.grid.high - self.grid.low) * 2 - 1
        raw = F.grid_sample(
            self.raw[None, None],
            unit.flip(-1).view(1, 1, 1, -1, 3),
            padding_mode="border",
            align_corners=True,
        )
        return DENSITY_SCALE * F.softplus(raw.view(points.shape[:-1]))

    def sight(self, rays: Rays, step: float, search: Search | None = None) -> Sight:
        """The surface along rays, sampled where `ray_marching.march` samples them.

        Args:
            rays: head frame.
            step: distance between samples, head units.
            search: where along each ray to search.
        """
        enter, leave = search_interval(rays, self.grid, step, search or Search())
        span = (leave - enter).amax().clamp_min(0) if len(enter) else enter.new_zeros(())
        steps = torch.arange(int(torch.ceil(span / step).item()), device=enter.device)
        along = enter[:, None] + (steps + 0.5) * step
        points = rays.origins[:, None] + along[..., None] * rays.directions[:, None]
        # Equation (8), as in `render_rays`.
        thickness = (self(points) * step).where(along < leave[:, None], 0)
        before = F.pad(thickness.cumsum(1), (1, 0))
        weights = torch.exp(-before[:, :-1]) - torch.exp(-before[:, 1:])
        opacity = weights.sum(1)
        return Sight(opacity, (weights * along).sum(1) / opacity.clamp_min(1e-6))


class BakedDensity(nn.Module):
    """Density before softplus at lattice points, linear in what describes a frame.

    Attributes:
        at: flat index of each point in a lattice of (G + 1)^3 points; empty before `bake`.
        slopes: of each number that describes a frame, then the constant.
        low, high: least and largest of these numbers where it was fitted.
    """

    at: Int[Tensor, " V"]
    slopes: Float[Tensor, "D1 V"]
    low: Float[Tensor, " D"]
    high: Float[Tensor, " D"]

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("at", torch.zeros(0, dtype=torch.int32))
        for name in ("slopes", "low", "high"):
            self.register_buffer(name, torch.zeros((0, 0) if name == "slopes" else 0))

    @property
    def is_empty(self) -> bool:
        """Whether nothing was baked."""
        return not len(self.at)

    @torch.no_grad()
    def bake(
        self,
        grid: OccupancyGrid,
        described: Float[Tensor, "T D"],
        origins: Float[Tensor, "T 3"],
        field_of: Callable[[int], PointField],
    ) -> None:
        """Fits the density to that of frames.

        Args:
            grid: the corners of its open cells become lattice points.
            described: the numbers that describe each frame.
            origins: of their cameras, head frame.
            field_of: the field in a frame, seen from its camera.
        """
        self.at = corners(grid.occupied).view(-1).nonzero()[:, 0].int()
        points = lattice(grid).view(-1, 3)[self.at]
        raw = []
        for frame, origin in enumerate(origins):
            directions = F.normalize(points - origin, dim=-1)
            zero = torch.zeros(len(points), dtype=torch.long, device=points.device)
            density = field_of(frame)(points, directions, zero).density / DENSITY_SCALE
            raw.append(density.expm1().log().where(density < SOLID, SOLID).clamp_min(EMPTY))
        self.low, self.high = described.amin(0), described.amax(0)
        self.slopes = ridge(described, torch.stack(raw))

    def of_frame(self, grid: OccupancyGrid, described: Float[Tensor, " D"]) -> DensityOfFrame:
        """The density of a frame that numbers describe; no further than where it was fitted."""
        inside = described.clamp(self.low, self.high)
        raw = grid.low.new_full(((grid.resolution + 1) ** 3,), EMPTY)
        raw[self.at] = inside @ self.slopes[:-1] + self.slopes[-1]
        return DensityOfFrame(grid, raw.view((grid.resolution + 1,) * 3))


def ridge(inputs: Float[Tensor, "T D"], values: Float[Tensor, "T V"]) -> Float[Tensor, "D1 V"]:
    """Slopes and constant of a ridge regression; inputs count by their spread."""
    centre = inputs.mean(0)
    x = (inputs - centre).double()
    square = x.T @ x + torch.diag(RIDGE * x.square().mean(0) + 1e-9)
    slopes = torch.linalg.solve(square, x.T @ (values - values.mean(0)).double()).float()
    return torch.cat([slopes, (values.mean(0) - centre @ slopes)[None]])


def corners(occupied: Bool[Tensor, "G G G"]) -> Bool[Tensor, "g g g"]:
    """Lattice points that are a corner of an open cell, g = G + 1."""
    around = F.pad(occupied.float(), (1,) * 6)
    return F.max_pool3d(around[None, None], 2, 1)[0, 0] > 0


def lattice(grid: OccupancyGrid) -> Float[Tensor, "g g g 3"]:
    """All lattice points, head frame."""
    axis = torch.arange(grid.resolution + 1, device=grid.low.device) / grid.resolution
    unit = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), -1)
    return grid.low + unit * (grid.high - grid.low)
