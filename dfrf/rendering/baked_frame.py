"""Renders a whole frame of a head off its baked density.

The density is looked up along rays through every fourth pixel of every fourth row. Where they see
the head, the field is evaluated once: where each view shows that point, and how much it counts.
Between these pixels that is interpolated; the views themselves are read for every pixel. At the
head's edge, opacity is looked up for every pixel too.

h x w vertices at every fourth pixel of a window into the frame, C channels, P pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from dfrf.cameras import Camera, Rays
from dfrf.field.reference_encoder import COLOUR
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.baked_density import DensityOfFrame
from dfrf.rendering.frame_renderer import BLOCK, grown, head_blocks
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.surface_details import SurfaceDetails
from dfrf.rendering.volume_rendering import Volume

SEEN = 0.05  # opacity from which the field is asked what it sees
FAINT, OPAQUE = 0.02, 0.98  # opacities between which a pixel lies on the head's edge
SPREAD = 3  # vertices beyond the head that get what is known at the nearest
BEHIND = 0.3  # head units that a surface may lie before or behind that of its neighbours


@dataclass(frozen=True)
class Pictures:
    """Colours of a person's views as images.

    Attributes:
        whole: the references.
        mouths: the crops round the mouth; none without.
    """

    whole: Float[Tensor, "N 3 H W"]
    mouths: Float[Tensor, "P 3 I J"]

    @classmethod
    def of(cls, maps: ReferenceMaps) -> Self:
        """Those of maps."""
        return cls(images(maps), maps.table.new_zeros(0, 3, 1, 1) if maps.mouths is None else images(maps.mouths))

    def read_by(self, maps: ReferenceMaps) -> list[Float[Tensor, "3 _ _"]]:
        """Those that maps of one frame choose, in the order of `Shading.positions`."""
        chosen = [self.whole[i] for i in maps.number]
        return chosen + [self.mouths[i] for mouths in maps.chosen for i in mouths.maps.number]


def images(maps: ReferenceMaps) -> Float[Tensor, "N 3 H W"]:
    """Colours of all views in the table of maps."""
    table = maps.table.view(-1, maps.height, maps.width, maps.table.shape[1])
    return table[..., COLOUR].movedim(-1, 1).float().contiguous()


def unit(positions: Float[Tensor, "M 2"], image: Float[Tensor, "3 H W"]) -> Float[Tensor, "M 2"]:
    """Positions as `grid_sample` takes them."""
    height, width = image.shape[1:]
    return positions * 2 / positions.new_tensor([width - 1, height - 1]) - 1


def spread(
    values: Float[Tensor, "C h w"], known: Bool[Tensor, "h w"], times: int = SPREAD
) -> Float[Tensor, "C h w"]:
    """Values where they are known, and the mean of known neighbours beside them."""
    weight = known.to(values.dtype)[None]
    values = values * weight
    for _ in range(times):
        total, count = (F.avg_pool2d(x[None], 3, 1, 1)[0] for x in (values, weight))
        new = (weight == 0) & (count > 0)
        values = torch.where(new, total / count.clamp_min(1e-6), values)
        weight = torch.where(new, 1.0, weight)
    return values


def between(values: Float[Tensor, "C h w"]) -> Float[Tensor, "C H W"]:
    """Values at all pixels up to the last vertex."""
    size = [BLOCK * (n - 1) + 1 for n in values.shape[1:]]
    return F.interpolate(values[None], size, mode="bilinear", align_corners=True)[0]


def colours(
    pictures: list[Float[Tensor, "3 _ _"]], shown: Float[Tensor, "C h w"]
) -> Float[Tensor, "3 H W"]:
    """Colours of all pixels, without opacity.

    Args:
        pictures: V views.
        shown: at vertices: the residual, then share and position of each view.
    """
    residual, of_views = shown[:3], shown[3:].unflatten(0, (-1, 3))
    total = between(residual)
    for picture, view in zip(pictures, of_views, strict=True):
        seen = grown(view[0] > 0, 1)
        if not seen.any():
            continue
        rows, columns = (range_of(seen.any(axis)) for axis in (1, 0))
        fine = between(view[:, rows, columns])
        colour = F.grid_sample(
            picture[None], fine[None, 1:].movedim(1, -1), padding_mode="border", align_corners=True
        )[0]
        inside = [slice(BLOCK * i.start, BLOCK * (i.stop - 1) + 1) for i in (rows, columns)]
        total[:, inside[0], inside[1]].addcmul_(fine[:1], colour)
    return total


def range_of(some: Bool[Tensor, " n"]) -> slice:
    """From the first to the last that is true."""
    at = some.nonzero()
    return slice(int(at[0]), int(at[-1]) + 1)


@torch.no_grad()
def render_baked_frame(
    volume: Volume,
    density: DensityOfFrame,
    pictures: Pictures,
    camera: Camera,
    region: Bool[Tensor, "S S"] | None = None,
) -> tuple[Float[Tensor, "S S 3"], Float[Tensor, "S S"]]:
    """The head of one frame, on the device of its camera; as `frame_renderer.render_frame`.

    Args:
        volume: the head as it is in that frame; its field has references.
        density: its density, baked.
        pictures: of its references.
        camera: of the frame.
        region: the pixels that are needed; others may be left blank. None is all.
    """
    size, step = camera.size, volume.march.step
    frame = torch.zeros(size, size, 4, device=camera.c2w.device)
    blocks = head_blocks(volume.grid, camera, region)
    if not blocks.any():
        return frame[..., :3], frame[..., 3]
    details = SurfaceDetails.of(volume.field.seen_from(camera.c2w[:, 3]))
    assert details is not None
    blocks = grown(blocks, 1)
    rows, columns = (range_of(blocks.any(axis)) for axis in (1, 0))
    known = blocks[rows, columns]
    first = torch.tensor([rows.start, columns.start], device=known.device) * BLOCK

    def rays(at: tuple[Tensor, Tensor]) -> Rays:
        return camera.rays((at[0] + first[0]) * size + at[1] + first[1])

    at = known.nonzero(as_tuple=True)
    coarse = rays(tuple(i * BLOCK for i in at))
    sight = density.sight(coarse, step)
    opacity, depth = (known.new_zeros(known.shape, dtype=torch.float32) for _ in range(2))
    opacity[at], depth[at] = sight.opacity, sight.depth
    hits = (sight.opacity > SEEN).nonzero()[:, 0]
    directions = coarse.directions[hits]
    shading = details.shade(coarse.origins[hits] + sight.depth[hits, None] * directions, directions)
    views = pictures.read_by(details.maps)
    rows_of_views = [
        torch.cat([share[:, None], unit(position, picture)], 1)
        for share, position, picture in zip(shading.shares, shading.positions, views, strict=True)
    ]
    shown = opacity.new_zeros(3 + 3 * len(views), *known.shape)
    places = tuple(i[hits] for i in at)
    shown[:, places[0], places[1]] = torch.cat([shading.residual, *rows_of_views], 1).T
    seen = torch.zeros_like(known)
    seen[places] = True
    colour = colours(views, spread(shown, seen))
    fine = between(opacity[None])[0]
    edge = edges(opacity)
    height, width = (min(a, size - int(b)) for a, b in zip(fine.shape, first, strict=True))
    pixels = edge[:height, :width].nonzero(as_tuple=True)
    near = -F.max_pool2d(-depth.where(seen, torch.inf)[None], 3, 1, 1)
    far = F.max_pool2d(depth[None], 3, 1, 1)
    near, far = (x[0].repeat_interleave(BLOCK, 0).repeat_interleave(BLOCK, 1) for x in (near, far))
    limits = near[pixels] - BEHIND, far[pixels] + BEHIND
    fine[pixels] = density.sight(rays(pixels), step, Search(between=limits)).opacity
    inside = frame[first[0] : first[0] + height, first[1] : first[1] + width]
    inside[..., 3] = fine[:height, :width]
    inside[..., :3] = (colour * fine).movedim(0, -1)[:height, :width]
    return frame[..., :3], frame[..., 3]


def edges(opacity: Float[Tensor, "h w"]) -> Bool[Tensor, "H W"]:
    """Pixels between vertices of which some are opaque or faint and others are not."""
    most, least = (F.max_pool2d(x[None], 3, 1, 1)[0] for x in (opacity, -opacity))
    edge = (most > FAINT) & (-least < OPAQUE)
    return between(edge.float()[None])[0] > 0
