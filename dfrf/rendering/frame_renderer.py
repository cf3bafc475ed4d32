"""Renders a whole frame of a head, coarse to fine.

Every fourth pixel of every fourth row is rendered, then every second, then all. Pixels between
others that see one smooth surface are filled in: references are read where that surface must be,
and the field's residual to them is interpolated (`surface_details`).

S the side of the image, b = S / 4 blocks of 4 x 4 pixels along it, P pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from dfrf.cameras import Camera, Rays
from dfrf.rendering.frame_buffer import (
    ANCHORS,
    DEPTH,
    OPACITY,
    RESIDUAL,
    FrameBuffer,
    HeadImage,
    Pixels,
    Surroundings,
)
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.surface_details import SurfaceDetails
from dfrf.rendering.volume_rendering import RayColours, Volume, render_rays

STRIDES = (4, 2, 1)
BLOCK = STRIDES[0]
RAYS_AT_ONCE = 32768
NEGLIGIBLE = 0.01  # weight of a sample that neighbours ignore
VISIBLE_OPACITY = 0.5  # opacity from which a ray sees a surface


def grown(blocks: Bool[Tensor, "h w"], times: int) -> Bool[Tensor, "h w"]:
    """Blocks with those that are at most `times` blocks away."""
    return F.max_pool2d(blocks.float()[None], 2 * times + 1, 1, times)[0] > 0


def head_blocks(
    grid: OccupancyGrid, camera: Camera, region: Bool[Tensor, "S S"] | None = None
) -> Bool[Tensor, "b b"]:
    """Blocks of pixels that open cells can cover in a frame.

    Every open cell is splatted as a square that covers its projection, so no ray that would meet an
    open cell is left out. With a region, only blocks with pixels of it are returned.
    """
    c2w, focal, centre, size = camera.c2w, camera.focal, camera.centre, camera.size
    side = -(-size // BLOCK)
    local = (grid.open_centres() - c2w[:, 3]) @ c2w[:, :3]
    cell = ((grid.high - grid.low) / grid.resolution).norm() / 2
    local = local[-local[:, 2] > cell]  # a camera sees nothing that lies behind it
    depth = -local[:, 2]
    column = (centre[0] + focal * local[:, 0] / depth) / BLOCK
    row = (centre[1] - focal * local[:, 1] / depth) / BLOCK
    reach = focal * cell / depth.min() / BLOCK if depth.numel() else cell
    radius = int(torch.ceil(reach).item())
    blocks = torch.zeros(side, side, dtype=torch.bool, device=c2w.device)
    inside = (column > -radius) & (column < side + radius) & (row > -radius) & (row < side + radius)
    at = [i[inside].floor().long().clamp(0, side - 1) for i in (row, column)]
    blocks[at[0], at[1]] = True
    blocks = grown(blocks, radius)
    if region is not None:
        blocks &= F.max_pool2d(region.float()[None], BLOCK, ceil_mode=True)[0] > 0
    return blocks


@dataclass(frozen=True)
class FrameRenderer:
    """Fills the buffer of one frame.

    Attributes:
        volume: the head as it is in that frame, the only one of its conditioning.
        camera: of the frame.
        details: colours of its references; None for a field without: every pixel is rendered.
        buffer: the pixels so far.
    """

    volume: Volume
    camera: Camera
    details: SurfaceDetails | None
    buffer: FrameBuffer

    def rays(self, at: Pixels) -> Rays:
        """Rays through pixels of the buffer."""
        row, column = at
        number = (row + self.buffer.row) * self.camera.size + column + self.buffer.column
        return self.camera.rays(number)

    def render(self, at: Pixels, between: Sequence[Float[Tensor, " P"]] = ()) -> None:
        """Renders pixels, sampling each ray between two distances, or everywhere."""
        for first in range(0, len(at[0]), RAYS_AT_ONCE):
            part = slice(first, first + RAYS_AT_ONCE)
            some = at[0][part], at[1][part]
            rays = self.rays(some)
            search = Search(between=(between[0][part], between[1][part]) if between else None)
            self.write(some, rays, render_rays(self.volume, rays, search))

    def write(self, at: Pixels, rays: Rays, rendered: RayColours) -> None:
        """Writes the rendered rays of pixels."""
        buffer, opacity = self.buffer, rendered.opacity
        counts = rendered.weights > NEGLIGIBLE
        buffer.colour[at] = rendered.colour
        buffer.near[at] = torch.where(counts, rendered.distances, torch.inf).amin(1)
        buffer.far[at] = torch.where(counts, rendered.distances, -torch.inf).amax(1)
        depth = rendered.depth / opacity.clamp_min(VISIBLE_OPACITY)
        surface = buffer.surface.new_zeros(len(opacity), buffer.surface.shape[-1])
        surface[:, OPACITY], surface[:, DEPTH] = opacity, depth
        hits = (opacity > VISIBLE_OPACITY).nonzero()[:, 0]
        if self.details is not None and len(hits):
            directions = rays.directions[hits]
            points = rays.origins[hits] + depth[hits, None] * directions
            anchors = self.details.anchors(points, directions)
            reference_colours = self.details.colours(points, anchors)
            residual = rendered.colour[hits] / opacity[hits, None] - reference_colours
            surface[hits, 2:] = torch.cat([residual, anchors], 1)
        buffer.surface[at] = surface

    def fill(self, at: Pixels, around: Surroundings) -> Bool[Tensor, " P"]:
        """Fills in pixels between others that see one smooth surface.

        Returns:
            Which of them are filled in.
        """
        if self.details is None:
            return torch.zeros_like(around.smooth)
        some = around.smooth.nonzero()[:, 0]
        pixels, surface = (at[0][some], at[1][some]), around.surface[some]
        rays = self.rays(pixels)
        points = rays.origins + surface[:, DEPTH, None] * rays.directions
        reference_colours = self.details.colours(points, surface[:, ANCHORS])
        self.buffer.colour[pixels] = surface[:, OPACITY, None] * (
            reference_colours + surface[:, RESIDUAL]
        )
        self.buffer.near[pixels] = around.near[some]
        self.buffer.far[pixels] = around.far[some]
        self.buffer.surface[pixels] = surface
        return around.smooth


@torch.no_grad()
def render_frame(
    volume: Volume, camera: Camera, region: Bool[Tensor, "S S"] | None = None
) -> HeadImage:
    """The head of one frame, on the device of its camera.

    Args:
        volume: the head as it is in that frame, the only one of its conditioning.
        camera: of the frame.
        region: the pixels that are needed; others may be left blank. None is all.

    Returns:
        Premultiplied colour in 0..1, and opacity.
    """
    blocks, size = head_blocks(volume.grid, camera, region), camera.size
    if not blocks.any():
        blank = torch.zeros(size, size, 4, device=camera.c2w.device)
        return blank[..., :3], blank[..., 3]
    details = SurfaceDetails.of(volume.field.seen_from(camera.c2w[:, 3]))
    count = 0 if details is None else details.anchor_count
    # What a pixel gets depends on neighbours at larger strides, so these reach further.
    buffer = FrameBuffer.of_blocks(grown(blocks, 2), BLOCK, count)
    renderer = FrameRenderer(volume, camera, details, buffer)
    for level, stride in enumerate(STRIDES):
        at = buffer.new_pixels(grown(blocks, 2 - level), BLOCK, stride, size)
        if not level:
            renderer.render(at)
            continue
        around = buffer.surroundings(at, stride)
        left = ~renderer.fill(at, around)
        if stride > 1:
            renderer.render((at[0][left], at[1][left]))
        else:
            left &= around.near <= around.far
            renderer.render((at[0][left], at[1][left]), (around.near[left], around.far[left]))
    return buffer.frame(size)
