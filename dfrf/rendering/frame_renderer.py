"""A whole frame of a head: which pixels it can cover, and what their rays see.

G tiles of P pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.cameras import pixel_rays
from dfrf.field.model import Model
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.volume_rendering import RayColours, render_rays

RAYS_AT_ONCE = 32768
NEGLIGIBLE = 0.01  # weight of a sample that neighbours need not look for


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
    model: Model,
    c2w: Tensor,
    focal: float,
    centre: Tensor,
    size: int,
    side: int,
    region: Tensor | None = None,
) -> Tensor:
    """Pixels (G, side * side) (row-major) of the tiles that open cells can cover in a frame.

    Every open cell is splatted as a disc that covers its projection, so no ray that would meet an
    open cell is left out. Of a region (S, S) bool only those tiles are given that hold pixels of
    it, and those beside them: how far to look and how to sharpen is learned from neighbours.
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
    covered = F.max_pool2d(grown, side)[0, 0]
    if region is not None:
        asked = F.max_pool2d(region.float()[None], side)
        covered = covered * F.max_pool2d(asked, 3, stride=1, padding=1)[0]
    row, column = torch.nonzero(covered > 0).unbind(-1)
    within = torch.arange(side, device=c2w.device)
    first = row * side * size + column * side
    return first[:, None] + (within[:, None] * size + within).view(-1)


@dataclass(frozen=True)
class Picture:
    """A frame of S x S pixels in the making, each row-major.

    Attributes:
        colour: (S * S, 3) premultiplied; opacity: (S * S,).
        near, far: (S * S,) distances of the first and the last sample of each ray that counts.
    """

    size: int
    colour: Tensor
    opacity: Tensor
    near: Tensor
    far: Tensor

    @classmethod
    def blank(cls, size: int, device: torch.device) -> Self:
        """Nothing seen yet."""
        count = size * size
        unseen = torch.full((count,), torch.inf, device=device)
        colour = torch.zeros(count, 3, device=device)
        return cls(size, colour, torch.zeros(count, device=device), unseen, -unseen)

    def note(self, pixels: Tensor, seen: RayColours) -> None:
        """Takes what rays (P,) through these pixels see."""
        counts = seen.weights > NEGLIGIBLE
        self.colour[pixels] = seen.colour
        self.opacity[pixels] = seen.opacity
        self.near[pixels] = torch.where(counts, seen.distances, torch.inf).amin(1)
        self.far[pixels] = torch.where(counts, seen.distances, -torch.inf).amax(1)

    def between(self, pixels: Tensor, apart: int) -> tuple[Tensor, Tensor]:
        """From where to where to look along the rays of pixels (...), (...) and (...).

        As far as the rays round them do that are so many pixels apart: nine of them, so that
        nothing wider than twice that is left out. Where none sees anything, the first is larger.
        """
        column, row = pixels % self.size // apart, pixels // self.size // apart
        limits = []
        for sign, distance in ((-1, self.near), (1, self.far)):
            some = sign * distance.view(self.size, self.size)[::apart, ::apart]
            limits.append(sign * F.max_pool2d(some[None, None], 3, 1, 1)[0, 0][row, column])
        return limits[0], limits[1]


@torch.no_grad()
def render_frame(
    model: Model,
    c2w: Tensor,
    focal: float,
    centre: Tensor,
    told: Tensor,
    maps: ReferenceMaps | None,
    size: int,
    region: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """The head of one frame, on the device of its camera.

    Where a ray meets the head, those beside it nearly do. So rays a quarter of a tile apart are
    looked along from end to end, and all others only where the ones round them saw anything.

    Args:
        c2w: (3, 4); focal in pixels; centre (2,).
        told: (told_dim,) what the field is told of the frame.
        maps: reference features.
        size: S, side of the square picture.
        region: (S, S) bool, the pixels that are asked for; others may be left blank. None is all.

    Returns:
        Premultiplied colour (S, S, 3) in 0..1 and opacity (S, S).
    """
    side = tile_side(model, c2w, focal, size)
    tiles = head_tiles(model, c2w, focal, centre, size, side, region)
    apart = max(1, side // 4)
    picture = Picture.blank(size, c2w.device)
    if not len(tiles):
        return picture.colour.view(size, size, 3), picture.opacity.view(size, size)

    def render(pixels: Tensor, near: Tensor, far: Tensor) -> None:
        """Looks along the rays of pixels (G, P), from the distances (G, P) to those."""
        group = pixels.shape[1]
        some = RAYS_AT_ONCE // group
        for these, *ends in zip(pixels.split(some), near.split(some), far.split(some), strict=True):
            part = these.view(-1)
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
                group=group,
                between=(ends[0].view(-1), ends[1].view(-1)),
            )
            picture.note(part, seen)

    within = torch.arange(side, device=tiles.device) % apart == 0
    first = (within[:, None] & within).view(-1)
    whole = torch.zeros(len(tiles), int(first.sum()), device=c2w.device)
    render(tiles[:, first], whole, whole + torch.inf)
    if apart > 1:
        rest = tiles[:, ~first]
        near, far = picture.between(rest, apart)
        some = (near <= far).any(1)
        render(rest[some], near[some], far[some])
    return picture.colour.view(size, size, 3), picture.opacity.view(size, size)
