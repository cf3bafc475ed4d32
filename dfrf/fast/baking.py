"""Computes once what a learned model needs: its empty cells, and its baked density.

T frames, K numbers of conditioning, V corners of cells.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf.fast.fast_model import FastModel
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.baked_density import chosen_frames, corners, positions
from dfrf.rendering.grid_pruning import prune_grid
from dfrf.rendering.volume_rendering import density_at
from dfrf.workers import Workers

AT_ONCE = 8  # frames


def prune(
    model: FastModel,
    conditioning: Float[Tensor, "T K"],
    c2w: Float[Tensor, "T 3 4"],
    maps: ReferenceMaps | None,
    generator: torch.Generator,
) -> None:
    """Closes the cells that are empty in all of these frames."""

    def field_of(frame: int) -> ConditionedField:
        return ConditionedField(model.field, conditioning[frame : frame + 1], maps)

    prune_grid(model.grid, model.config.march.step, field_of, c2w, generator)


@torch.no_grad()
def bake(
    model: FastModel,
    conditioning: Float[Tensor, "T K"],
    origins: Float[Tensor, "T 3"],
    maps: ReferenceMaps,
    count: int,
) -> None:
    """Fits the baked density of a learned model to `count` of these frames."""
    described = model.described(conditioning, origins)
    some = chosen_frames(described, count)
    points = corners(model.grid.occupied)
    at, rounded = positions(model.grid, points), model.rounded()

    def density(frame: int) -> Float[Tensor, " V"]:
        volume = rounded.volume(conditioning[frame : frame + 1], maps)
        return density_at(volume.field.seen_from(origins[frame]), at, origins[frame])

    with Workers(model.device, AT_ONCE) as workers:
        of_frames = torch.stack(list(workers.map(density, some)))
    model.baked.fit(points, described[some], of_frames)
