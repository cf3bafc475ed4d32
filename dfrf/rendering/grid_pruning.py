"""Closing the cells of the grid in which a finished model shows nothing.

While a model learns, cells beside a surface stay open so that it can move. When it no longer
learns, half of the samples of a frame would be spent on that air.

F frames, M points.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.field import eyelid_deformation as lids
from dfrf.field.model import Model
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.ray_marching import PackedSamples
from dfrf.rendering.volume_rendering import evaluate

THIN = 0.01  # opacity of a sample
FRAMES = 64


@torch.no_grad()
def carve(
    model: Model,
    told: Tensor,
    c2w: Tensor,
    maps: ReferenceMaps | None,
    generator: torch.Generator,
) -> None:
    """Closes open cells where no sample of any frame looked at would be `THIN` or more.

    The density itself is asked, one random point a cell and frame, so a cell that rays seldom
    reached stays open where there is something in it. In every second frame the eyes are shut,
    where the model has references.

    Args:
        model: changed in place: only its grid.
        told: (F, told_dim) what the field is told of each frame; at most `FRAMES` are looked at.
        c2w: (F, 3, 4) their cameras.
        maps: reference features, or None.
        generator: draws frames and points.
    """
    grid = model.grid
    device = grid.low.device
    open_cells = torch.nonzero(grid.occupied.view(-1)).view(-1)
    centres = grid.centres()[open_cells]
    size = (grid.high - grid.low) / grid.resolution
    count = len(open_cells)
    ray = torch.arange(count, device=device)
    zero = torch.zeros(count, dtype=torch.long, device=device)
    thickest = torch.zeros(count, device=device)
    # A field without references is told of lids instead of moving them, and never so much.
    asleep = told if maps is None else lids.shut(told, model.config.field.code_dim)
    for k, frame in enumerate(torch.randperm(len(told), generator=generator)[:FRAMES].tolist()):
        where = torch.rand(count, 3, generator=generator).to(device) - 0.5
        points = centres + where * size
        origin = c2w[frame, :, 3].to(device)
        directions = F.normalize(points - origin, dim=-1)
        samples = PackedSamples(points, ray, zero, torch.zeros_like(thickest), 1, count)
        # Shut lids lie where open eyes have nothing, and blinks are rare.
        codes = (asleep if k % 2 else told)[frame : frame + 1]
        near = None if maps is None else maps.near(origin, model.config.field.references)
        out = evaluate(model, samples, directions, zero, codes, near, True)
        opacity = -torch.expm1(-out.density * model.config.march.step)
        thickest = torch.maximum(thickest, opacity)
    grid.occupied.view(-1)[open_cells] = thickest >= THIN
