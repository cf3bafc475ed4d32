"""The surface that each view of a person sees, from the learned density.

N views of H x W pixels, h x w places in each, at least `SPACING` apart.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.cameras import Rays, pixel_rays
from dfrf.field.reference_views import ReferenceViews
from dfrf.rendering.volume_rendering import Volume, render_rays

SPACING = 12.0  # pixels at 512 between two places
OPAQUE = 0.5  # opacity from which a ray sees a surface


@torch.no_grad()
def surfaces(volume: Callable[[int], Volume], views: ReferenceViews) -> Float[Tensor, "N h w"]:
    """Distance from each camera to the surface it sees at places all over its view; 0 where none.

    Beside the edge of a surface in front, where pixels show some of both, the nearer one counts;
    beside the edge of the head there is none.

    Args:
        volume: the head as it is in the view of that number.
        views: with their images.
    """
    height, width = views.mattes.shape[1:]
    spacing = max(1.0, SPACING * views.scale)
    rows, columns = (max(2, round(side / spacing)) for side in (height, width))
    down, right = (torch.linspace(0, side - 1, n) for side, n in ((height, rows), (width, columns)))
    places = torch.stack([x.flatten() for x in torch.meshgrid(right, down, indexing="xy")], -1)
    seen = [_distances(volume(k), views, k, places) for k in range(len(views.c2w))]
    return nearest_around(torch.stack(seen).view(-1, rows, columns))


def _distances(
    volume: Volume, views: ReferenceViews, number: int, places: Float[Tensor, "P 2"]
) -> Float[Tensor, " P"]:
    """Distance to the surface at places of one view; 0 where there is none."""
    device = views.c2w.device
    origins, directions = pixel_rays(
        views.c2w[number].expand(len(places), 3, 4),
        views.focal,
        views.centres[number].expand(len(places), 2),
        places.to(device),
    )
    frame = torch.zeros(len(places), dtype=torch.long, device=device)
    seen = render_rays(volume, Rays(origins, F.normalize(directions, dim=-1), frame))
    distance = seen.depth / seen.opacity.clamp_min(OPAQUE)
    return torch.where(seen.opacity > OPAQUE, distance, 0)


def nearest_around(distance: Float[Tensor, "N h w"]) -> Float[Tensor, "N h w"]:
    """The least distance at each place and beside it."""
    return -F.max_pool2d(-distance, 3, 1, 1)
