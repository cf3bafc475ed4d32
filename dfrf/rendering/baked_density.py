"""The density of a learned head on a lattice: looked up where marching asks a network.

Before softplus, density changes so slowly that it can be interpolated between lattice points, and
between frames by what describes them: lips, upper face and viewpoint.

V lattice points, g of them along an axis, D numbers that describe a frame, T frames, R rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from dfrf.cameras import Rays
from dfrf.field.field import DENSITY_SCALE
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import Search, candidates

# Before softplus: a sample of EMPTY is transparent, one of SOLID is opaque.
EMPTY, SOLID = -8.0, 4.0
# Nothing is below: a sample of .05 head units has an opacity of .003 there, but all those of a ray
# through the whole box would be a haze.
AIR = -6.0
NOISE = 0.1  # variance of a frame's density beside what describes it, that of a like frame being 2
LENGTH = 1.5  # standard deviations in each number, over which frames are alike
REPRESENTATIVE = 2 / 3  # of the frames to fit it to; the others are the most unlike
MIN_OPACITY = 1e-6


@dataclass(frozen=True)
class FrameDensity:
    """The density of a head in one frame.

    Attributes:
        grid: its open cells; there is no density outside of their bounds.
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
        raw = raw.view(points.shape[:-1])
        return DENSITY_SCALE * F.softplus(raw).where(raw > AIR, 0)

    def along(
        self, rays: Rays, step: float, search: Search | None = None
    ) -> tuple[Float[Tensor, " R"], Float[Tensor, " R"]]:
        """Opacity of rays, and the mean distance that their light comes from.

        They are sampled where `ray_marching.march` samples them.

        Args:
            rays: head frame.
            step: distance between samples, head units.
            search: where along each ray to search; everywhere when None.
        """
        distance, searched = candidates(rays, self.grid, step, search or Search())
        points = rays.origins[:, None] + distance[..., None] * rays.directions[:, None]
        # Equation (8), as in `render_rays`.
        thickness = (self(points) * step).where(searched, 0)
        passed = torch.exp(-F.pad(thickness.cumsum(1), (1, 0)))
        weights = passed[:, :-1] - passed[:, 1:]
        opacity = weights.sum(1)
        return opacity, (weights * distance).sum(1) / opacity.clamp_min(MIN_OPACITY)


class BakedDensity(nn.Module):
    """Density before softplus of some frames at lattice points, and of frames between them.

    The density of another frame is the mean of a Gaussian process (Rasmussen and Williams 2006),
    whose kernel is linear with a bump: where frames are few, it goes on in straight lines.

    Attributes:
        side: g.
        points: places in the lattice, counted row by row; none before `fit`.
        described: the numbers that describe each frame it was fitted to.
        density: of each of these frames, before softplus, half precision.
    """

    points: Int[Tensor, " V"]
    described: Float[Tensor, "T D"]
    density: Float[Tensor, "T V"]

    def __init__(self, resolution: int) -> None:
        super().__init__()
        self.side = resolution + 1
        self.register_buffer("points", torch.zeros(0, dtype=torch.long))
        self.register_buffer("described", torch.zeros(1, 0))
        self.register_buffer("density", torch.zeros(1, 0, dtype=torch.half))

    def __bool__(self) -> bool:
        """Whether it was fitted."""
        return len(self.points) > 0

    @torch.no_grad()
    def fit(
        self,
        points: Int[Tensor, " V"],
        described: Float[Tensor, "T D"],
        density: Float[Tensor, "T V"],
    ) -> None:
        """Fits it to the density of frames.

        Args:
            points: places in the lattice.
            described: the numbers that describe each frame.
            density: of each frame at each point.
        """
        self.points, self.described = points, described.float()
        self.density = before_softplus(density).half()

    def of_frame(self, grid: OccupancyGrid, described: Float[Tensor, " D"]) -> FrameDensity:
        """The density of a frame; no number counts beyond those of the frames it was fitted to."""
        known = self.described
        inside = torch.minimum(torch.maximum(described, known.amin(0)), known.amax(0))
        middle, size = known.mean(0), known.std(0, correction=0).clamp_min(1e-6)
        frames, here = (((x - middle) / size).double() for x in (known, inside[None]))
        like = kernel(frames, frames) + NOISE * torch.eye(len(frames)).to(frames)
        weights = torch.linalg.solve(like, kernel(frames, here))[:, 0].float()
        weights += (1 - weights.sum()) / len(weights)  # of the difference from the mean frame
        raw = weights.new_full((self.side**3,), EMPTY)
        raw[self.points] = weights @ self.density.float()
        return FrameDensity(grid, raw.view((self.side,) * 3))

    def _load_from_state_dict(self, state: dict[str, Any], prefix: str, *rest: Any) -> None:
        """Takes the sizes of what is loaded; a model that was not baked, a base, has nothing."""
        for name, own in list(self.named_buffers()):
            found = state.setdefault(prefix + name, own)
            setattr(self, name, own.new_zeros(found.shape))
        super()._load_from_state_dict(state, prefix, *rest)
        if not self.fits():
            errors = rest[4]
            errors.append(f"{prefix.rstrip('.')}: tensors that do not belong together")

    def fits(self) -> bool:
        """Whether its tensors belong together."""
        points = self.points
        return (
            points.dim() == 1
            and bool(((points >= 0) & (points < self.side**3)).all())
            and self.described.dim() == 2
            and self.density.shape == (len(self.described), len(points))
        )


def before_softplus(density: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
    """What a density is the scaled softplus of, from `EMPTY` to `SOLID`."""
    scaled = density / DENSITY_SCALE
    return scaled.expm1().log().where(scaled < SOLID, SOLID).clamp_min(EMPTY)


def kernel(some: Float[Tensor, "A D"], others: Float[Tensor, "B D"]) -> Float[Tensor, "A B"]:
    """How alike frames are by numbers of mean 0 and variance 1; about 2 of a frame to itself."""
    count = max(some.shape[1], 1)
    apart = torch.cdist(some, others).square() / count
    return some @ others.T / count + torch.exp(-apart / (2 * LENGTH**2))


def chosen_frames(described: Float[Tensor, "T D"], count: int) -> list[int]:
    """Frames to fit it to: most of them evenly spaced in time, then those least like the chosen."""
    total = len(described)
    count = min(count, total)
    even = torch.linspace(0, total - 1, max(1, round(REPRESENTATIVE * count)))
    chosen = sorted(set(even.round().long().tolist()))
    size = described.std(0, correction=0).clamp_min(1e-6)
    apart = torch.cdist(described / size, described[chosen] / size).amin(1)
    while len(chosen) < count:
        chosen.append(int(apart.argmax()))
        apart = torch.minimum(apart, ((described - described[chosen[-1]]) / size).norm(dim=1))
    return sorted(chosen)


def corners(occupied: Bool[Tensor, "G G G"]) -> Int[Tensor, " V"]:
    """Places in the lattice of the points that are a corner of an open cell."""
    around = F.pad(occupied.float(), (1,) * 6)
    return F.max_pool3d(around[None, None], 2, 1).view(-1).nonzero()[:, 0]


def positions(grid: OccupancyGrid, points: Int[Tensor, " V"]) -> Float[Tensor, "V 3"]:
    """Lattice points, head frame."""
    side = grid.resolution + 1
    place = torch.stack([points // side**2, points // side % side, points % side], 1)
    return grid.low + place / grid.resolution * (grid.high - grid.low)
