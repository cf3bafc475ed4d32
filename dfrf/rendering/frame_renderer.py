"""A whole frame of a head: which pixels it can cover, and what their rays see.

G tiles of P pixels, S the side of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from dfrf.cameras import Camera
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.volume_rendering import RayColours, Volume, render_rays

RAYS_AT_ONCE = 32768
NEGLIGIBLE = 0.01  # weight of a sample that neighbours need not look for


def tile_side(grid: OccupancyGrid, camera: Camera) -> int:
    """Side in pixels of the square tiles whose rays stay within one cell of their mean."""
    c2w, focal, size = camera.c2w, camera.focal, camera.size
    cell = float(((grid.high - grid.low) / grid.resolution).min())
    far = float((c2w[:, 3] - (grid.low + grid.high) / 2).norm() + (grid.high - grid.low).norm() / 2)
    for side in (8, 4, 2):
        if size % side == 0 and (side - 1) / 2**0.5 * far / focal <= cell:
            return side
    return 1


def head_tiles(
    grid: OccupancyGrid, camera: Camera, side: int, region: Bool[Tensor, "S S"] | None = None
) -> Int[Tensor, "G P"]:
    """Pixels (row-major) of the tiles, P = side * side, that open cells can cover in a frame.

    Every open cell is splatted as a disc that covers its projection, so no ray that would meet an
    open cell is left out. Of a region only those tiles are given that hold pixels of
    it, and those beside them: how far to look and how to sharpen is learned from neighbours.
    """
    c2w, focal, centre, size = camera.c2w, camera.focal, camera.centre, camera.size
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
class FrameBuffer:
    """A frame of S x S pixels in the making, Q = S * S of them row by row.

    Attributes:
        size: S.
        colour: premultiplied.
        opacity: in 0..1.
        near, far: distances of the first and the last sample of each ray that counts.
    """

    size: int
    colour: Float[Tensor, "Q 3"]
    opacity: Float[Tensor, " Q"]
    near: Float[Tensor, " Q"]
    far: Float[Tensor, " Q"]

    @classmethod
    def blank(cls, size: int, device: torch.device) -> Self:
        """Nothing rendered yet."""
        count = size * size
        unseen = torch.full((count,), torch.inf, device=device)
        colour = torch.zeros(count, 3, device=device)
        return cls(size, colour, torch.zeros(count, device=device), unseen, -unseen)

    def write(self, pixels: Int[Tensor, " P"], rendered: RayColours) -> None:
        """Takes what rays through these pixels see."""
        counts = rendered.weights > NEGLIGIBLE
        self.colour[pixels] = rendered.colour
        self.opacity[pixels] = rendered.opacity
        self.near[pixels] = torch.where(counts, rendered.distances, torch.inf).amin(1)
        self.far[pixels] = torch.where(counts, rendered.distances, -torch.inf).amax(1)

    def interval(
        self, pixels: Int[Tensor, "*P"], apart: int
    ) -> tuple[Float[Tensor, "*P"], Float[Tensor, "*P"]]:
        """From where to where to look along the rays of pixels.

        As far as the rays round them do that are so many pixels apart: nine of them, so that
        nothing wider than twice that is left out. Where none sees anything, the first is larger.
        """
        column, row = pixels % self.size // apart, pixels // self.size // apart
        limits = []
        for sign, distance in ((-1, self.near), (1, self.far)):
            some = sign * distance.view(self.size, self.size)[::apart, ::apart]
            limits.append(sign * F.max_pool2d(some[None, None], 3, 1, 1)[0, 0][row, column])
        return limits[0], limits[1]


def render_pixels(
    volume: Volume,
    camera: Camera,
    buffer: FrameBuffer,
    pixels: Int[Tensor, "G P"],
    between: tuple[Float[Tensor, "G P"], Float[Tensor, "G P"]],
) -> None:
    """Renders groups of pixels into the buffer, looking along each ray between two distances."""
    group = pixels.shape[1]
    chunks = (values.split(RAYS_AT_ONCE // group) for values in (pixels, *between))
    for part, near, far in zip(*chunks, strict=True):
        search = Search(group=group, between=(near.view(-1), far.view(-1)))
        buffer.write(part.view(-1), render_rays(volume, camera.rays(part.view(-1)), search))


@torch.no_grad()
def render_frame(
    volume: Volume, camera: Camera, region: Bool[Tensor, "S S"] | None = None
) -> tuple[Float[Tensor, "S S 3"], Float[Tensor, "S S"]]:
    """The head of one frame, on the device of its camera.

    Where a ray meets the head, those beside it nearly do. So rays a quarter of a tile apart are
    looked along from end to end, and all others only where the ones round them saw anything.

    Args:
        volume: the head as it is in that frame, the only one of its conditioning.
        camera: that sees it.
        region: the pixels that are needed; others may be left blank. None is all.

    Returns:
        Premultiplied colour in 0..1, and opacity.
    """
    side = tile_side(volume.grid, camera)
    tiles = head_tiles(volume.grid, camera, side, region)
    apart, size = max(1, side // 4), camera.size
    buffer = FrameBuffer.blank(size, camera.c2w.device)
    if not len(tiles):
        return buffer.colour.view(size, size, 3), buffer.opacity.view(size, size)
    within = torch.arange(side, device=tiles.device) % apart == 0
    first = (within[:, None] & within).view(-1)
    whole = torch.zeros(len(tiles), int(first.sum()), device=camera.c2w.device)
    render_pixels(volume, camera, buffer, tiles[:, first], (whole, whole + torch.inf))
    if apart > 1:
        rest = tiles[:, ~first]
        near, far = buffer.interval(rest, apart)
        some = (near <= far).any(1)
        render_pixels(volume, camera, buffer, rest[some], (near[some], far[some]))
    return buffer.colour.view(size, size, 3), buffer.opacity.view(size, size)
