"""Closes the grid cells in which a finished model is empty.

In training, cells beside a surface stay open so that it can move. After training, half of the
samples of a frame would be spent on that air.

F frames.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.volume_rendering import ViewField, density_at

MIN_OPACITY = 0.01  # opacity of a sample


@torch.no_grad()
def prune_grid(
    grid: OccupancyGrid,
    step: float,
    field_of: Callable[[int], ViewField],
    origins: Float[Tensor, "F 3"],
    generator: torch.Generator,
) -> None:
    """Closes open cells where no sample of any of the frames has an opacity of `MIN_OPACITY`.

    The density itself is evaluated, at one random point a cell and frame, so a cell that rays
    seldom reached stays open if it is not empty.

    Args:
        grid: changed in place.
        step: length of a sample, head units.
        field_of: the field in a frame.
        origins: of the frames' cameras, head frame.
        generator: draws points.
    """
    device = grid.low.device
    open_cells = torch.nonzero(grid.occupied.view(-1)).view(-1)
    centres = grid.open_centres()
    size = (grid.high - grid.low) / grid.resolution
    empty = torch.ones(len(open_cells), dtype=torch.bool, device=device)
    for frame, origin in enumerate(origins.to(device)):
        where = torch.rand(len(open_cells), 3, generator=generator).to(device) - 0.5
        points = (centres + where * size)[empty]  # one frame that shows something is enough
        if not len(points):
            break
        density = density_at(field_of(frame).seen_from(origin), points, origin)
        empty[empty.clone()] = -torch.expm1(-density * step) < MIN_OPACITY
    grid.occupied.view(-1)[open_cells] = ~empty
