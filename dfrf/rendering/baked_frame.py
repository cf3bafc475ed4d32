"""Renders a whole frame of a head off its baked density.

Rays through every fourth pixel of every fourth row, the vertices, look the density up. Where they
see the head, the field is evaluated once: where each view shows that point, how much the view
counts, and the field's own colour. Between vertices, all that is interpolated; the views and their
mattes are read for every pixel. At the edge of the head, every pixel looks its opacity up.

h x w vertices of a window into the frame, H x W pixels of it, C channels, P pixels.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from dfrf.cameras import Camera, Rays
from dfrf.field.reference_encoder import MATTE
from dfrf.rendering.baked_density import FrameDensity
from dfrf.rendering.frame_buffer import HeadImage, Pixels
from dfrf.rendering.frame_renderer import BLOCK, grown, head_blocks
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.surface_details import SurfaceDetails
from dfrf.rendering.view_images import ViewImages, between, group, range_of, read, sampled, unit
from dfrf.rendering.volume_rendering import SeenRays, Volume

SEEN = 0.05  # opacity from which a vertex is asked what it shows
FAINT, OPAQUE = 0.02, 0.98  # opacities between which a pixel lies on the head's edge
SPREAD = 2  # vertices beyond those, which show what their neighbours show
DEEPER = 0.3  # head units that a surface may lie before or behind its neighbours'


def true_of(mask: Bool[Tensor, "h w"]) -> Pixels:
    """Rows and columns of what is true."""
    rows, columns = mask.nonzero(as_tuple=True)
    return rows, columns


def spread(values: Float[Tensor, "C h w"], known: Bool[Tensor, "h w"]) -> Float[Tensor, "C h w"]:
    """Values where they are known, and the mean of known neighbours up to `SPREAD` vertices off."""
    weight = known.to(values.dtype)[None]
    for _ in range(SPREAD):
        total, count = (F.avg_pool2d(x, 3, 1, 1) for x in (values * weight, weight))
        new = (weight == 0) & (count > 0)
        values = torch.where(new, total / count.clamp_min(1e-6), values)
        weight = torch.where(new, 1.0, weight)
    return values


def limits(
    opacity: Float[Tensor, "h w"], depth: Float[Tensor, "h w"], at: Pixels, stride: int
) -> tuple[Float[Tensor, " P"], Float[Tensor, " P"]]:
    """Where rays between known ones have to be searched; from inf on where nothing is.

    Args:
        opacity, depth: of rays `stride` apart.
        at: rows and columns of others, of which these have multiples of it.
    """
    some = opacity > FAINT
    ends = torch.stack([-depth.where(some, torch.inf), depth.where(some, -torch.inf)])
    near, far = F.max_pool2d(ends[None], 3, 1, 1)[0, :, at[0] // stride, at[1] // stride]
    return -near - DEEPER, far + DEEPER


def edge(opacity: Float[Tensor, "h w"]) -> Bool[Tensor, "H W"]:
    """Pixels between vertices that are not all opaque and not all faint."""
    most, least = F.max_pool2d(torch.stack([opacity, -opacity])[None], 3, 1, 1)[0]
    return between(((most > FAINT) & (-least < OPAQUE)).float()[None])[0] > 0


@dataclass(frozen=True)
class Window:
    """A part of a frame.

    Attributes:
        camera: of the frame.
        row, column: first of it.
    """

    camera: Camera
    row: int
    column: int

    def rays(self, at: Pixels) -> Rays:
        """Rays through pixels of the window."""
        return self.camera.rays_at(at[0] + self.row, at[1] + self.column)

    def vertex_rays(self, at: Pixels) -> Rays:
        """Rays through vertices of the window."""
        return self.rays((BLOCK * at[0], BLOCK * at[1]))


@dataclass(frozen=True)
class BakedHead:
    """The head in one frame.

    Attributes:
        volume: the field in that frame, with references.
        density: its density.
        images: colours of its references.
    """

    volume: Volume
    density: FrameDensity
    images: ViewImages

    @torch.no_grad()
    def render(self, camera: Camera, region: Bool[Tensor, "S S"] | None = None) -> HeadImage:
        """See `frame_head.FrameHead`."""
        size = camera.size
        frame = torch.zeros(4, size, size, device=camera.c2w.device)
        blocks = head_blocks(self.volume.grid, camera, region)
        if blocks.any():
            # A pixel depends on vertices of the next block, and these on those round them.
            blocks = F.pad(blocks, (0, 3, 0, 3))
            needed = grown(blocks, 2)
            rows, columns = (range_of(needed.any(axis)) for axis in (1, 0))
            rows, columns = (slice(i.start // 2 * 2, i.stop) for i in (rows, columns))
            window = Window(camera, BLOCK * rows.start, BLOCK * columns.start)
            both = self.window(window, needed[rows, columns], blocks[rows, columns])
            inside = frame[:, window.row :, window.column :]
            height, width = (
                min(a, b) for a, b in zip(both.shape[1:], inside.shape[1:], strict=True)
            )
            inside[:, :height, :width] = both[:, :height, :width]
        return frame[:3].movedim(0, -1), frame[3]

    def window(
        self, window: Window, needed: Bool[Tensor, "h w"], blocks: Bool[Tensor, "h w"]
    ) -> Float[Tensor, "4 H W"]:
        """Premultiplied colour and opacity of a window.

        Args:
            window: of the frame.
            needed: vertices; others may be left blank.
            blocks: blocks of pixels, below and right of each vertex; likewise.
        """
        opacity, depth = self.vertices(window, needed)
        colour = self.colours(window, opacity, depth)
        fine = between(opacity[None])
        shown = blocks.repeat_interleave(BLOCK, 0).repeat_interleave(BLOCK, 1)
        at = true_of(edge(opacity) & shown[: fine.shape[1], : fine.shape[2]])
        search = Search(between=limits(opacity, depth, at, BLOCK))
        fine[0, at[0], at[1]], _ = self.along(window.rays(at), search)
        return torch.cat([colour.mul_(fine), fine])

    def vertices(
        self, window: Window, needed: Bool[Tensor, "h w"]
    ) -> tuple[Float[Tensor, "h w"], Float[Tensor, "h w"]]:
        """Opacity and depth of the vertices that are needed: every second each way, then all."""
        opacity, depth = torch.zeros(2, *needed.shape, device=needed.device)
        first = torch.zeros_like(needed)
        first[::2, ::2] = grown(needed, 2)[::2, ::2]
        at = true_of(first)
        opacity[at], depth[at] = self.along(window.vertex_rays(at))
        at = true_of(needed & ~first)
        near, far = limits(opacity[::2, ::2], depth[::2, ::2], at, 2)
        some = near < far
        at = at[0][some], at[1][some]
        search = Search(between=(near[some], far[some]))
        opacity[at], depth[at] = self.along(window.vertex_rays(at), search)
        return opacity, depth

    def colours(
        self, window: Window, opacity: Float[Tensor, "h w"], depth: Float[Tensor, "h w"]
    ) -> Float[Tensor, "3 H W"]:
        """Colours of all pixels, without opacity, from what the field finds at the vertices."""
        details = SurfaceDetails.of(self.volume.field.seen_from(window.camera.c2w[:, 3]))
        assert details is not None
        at = true_of(opacity > SEEN)
        rays = window.vertex_rays(at)
        points = rays.origins + depth[at][:, None] * rays.directions
        shading = details.shade(points, rays.directions)
        groups = [views for views in self.images.chosen(details.maps) if views]
        sizes = [len(views) for views in groups]
        parts = [shading.own.T] + [
            group(*of)
            for of in zip(
                groups, shading.shares.split(sizes), shading.positions.split(sizes), strict=True
            )
        ]
        shown = opacity.new_zeros(sum(map(len, parts)), *opacity.shape)
        shown[:, at[0], at[1]] = torch.cat(parts)
        own, *of_views = spread(shown, opacity > SEEN).split([len(part) for part in parts])
        colour = between(own)
        for views, part in zip(groups, of_views, strict=True):
            colour += read(views, part)
        return colour

    def see(self, rays: Rays) -> SeenRays:
        """Single rays: the field is evaluated once for each that sees the head."""
        opacity, depth = self.along(rays)
        details = SurfaceDetails.of(self.volume.field.seen_from(rays.origins.mean(0)))
        assert details is not None
        at = (opacity > SEEN).nonzero()[:, 0]
        directions = rays.directions[at]
        shading = details.shade(rays.origins[at] + depth[at, None] * directions, directions)
        shown = shading.own
        views = itertools.chain(*self.images.chosen(details.maps))
        for image, share, place in zip(views, shading.shares, shading.positions, strict=True):
            some = share.nonzero()[:, 0]
            seen = sampled(image[:MATTE], unit(place[some], image)[None])[:, 0]
            shown = shown.index_add(0, some, share[some, None] * seen.T)
        colour = torch.zeros_like(rays.origins)
        colour[at] = shown * opacity[at, None]
        return SeenRays(colour, opacity, depth * opacity)

    def along(
        self, rays: Rays, search: Search | None = None
    ) -> tuple[Float[Tensor, " P"], Float[Tensor, " P"]]:
        """Opacity and depth of rays."""
        return self.density.along(rays, self.volume.march.step, search)
