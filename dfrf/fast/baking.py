"""Computes once what a learned model needs: its empty cells, and its baked density.

T frames, K numbers of conditioning, V corners of cells.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf.fast.fast_model import FastModel
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.baked_density import before_softplus, chosen_frames, corners, positions
from dfrf.rendering.grid_pruning import prune_grid
from dfrf.rendering.volume_rendering import density_at
from dfrf.workers import Workers

AT_ONCE = 8  # frames
PRUNING_FRAMES = 16
TELLING = 8  # frames at least in which density is evaluated everywhere
STILL = 0.3  # before softplus: where it changes less among these, it is the same in the others


def prune(
    model: FastModel,
    conditioning: Float[Tensor, "T K"],
    origins: Float[Tensor, "T 3"],
    maps: ReferenceMaps | None,
    generator: torch.Generator,
) -> None:
    """Closes the cells that are empty in these frames, as far as the least alike of them tell."""
    some = chosen_frames(model.described(conditioning, origins), PRUNING_FRAMES)

    def field_of(number: int) -> ConditionedField:
        return ConditionedField(model.field, conditioning[some[number]][None], maps)

    prune_grid(model.grid, model.config.march.step, field_of, origins[some], generator)


@torch.no_grad()
def bake(
    model: FastModel,
    conditioning: Float[Tensor, "T K"],
    origins: Float[Tensor, "T 3"],
    maps: ReferenceMaps,
    count: int,
) -> None:
    """Fits the baked density of a learned model to `count` of these frames.

    At about half of all points, those away from lips and jaw, frames hardly differ. There density
    is evaluated in `TELLING` or a few more of them, and is the mean of these in the others.
    """
    described = model.described(conditioning, origins)
    some = chosen_frames(described, count)
    points = corners(model.grid.occupied)
    at, rounded = positions(model.grid, points), model.rounded()

    def densities(frames: Sequence[int], where: Float[Tensor, "M 3"]) -> Float[Tensor, "N M"]:
        def density(frame: int) -> Float[Tensor, " M"]:
            volume = rounded.volume(conditioning[frame : frame + 1], maps)
            return density_at(volume.field.seen_from(origins[frame]), where, origins[frame])

        return torch.stack(list(workers.map(density, frames)))

    every = max(1, len(some) // TELLING)
    others = [k for k in range(len(some)) if k % every]
    with Workers(model.device, AT_ONCE) as workers:
        told = densities(some[::every], at)
        of_frames = told.mean(0).repeat(len(some), 1)
        of_frames[::every] = told
        if others:
            low, high = before_softplus(told).aminmax(dim=0)
            moves = (high - low > STILL).nonzero()[:, 0]
            found = densities([some[k] for k in others], at[moves])
            of_frames[torch.tensor(others, device=at.device)[:, None], moves] = found
    model.baked.fit(points, described[some], of_frames)
