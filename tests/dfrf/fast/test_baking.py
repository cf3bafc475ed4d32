"""Density is baked of some frames where these hardly differ, and of all of them elsewhere."""

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.fast import baking
from dfrf.field.field import DENSITY_SCALE
from dfrf.rendering.baked_density import corners, positions
from tests.dfrf.people import random_model

FRAMES = 24


def test_only_points_that_change_are_asked_for_in_every_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Here density changes from frame to frame below the middle."""
    model, maps = random_model()
    asked: list[int] = []

    def density_at(field: object, points: Tensor, origin: Tensor) -> Tensor:
        asked.append(len(points))
        changing = torch.where(points[:, 1] < 0, origin[0].sin(), 0.1 + 0.02 * origin[0].cos())
        return DENSITY_SCALE * F.softplus(changing)

    monkeypatch.setattr(baking, "density_at", density_at)
    origins = torch.zeros(FRAMES, 3)
    origins[:, 0], origins[:, 2] = torch.arange(FRAMES), 7
    baking.bake(model, torch.zeros(FRAMES, 70), origins, maps, FRAMES)
    below = positions(model.grid, corners(model.grid.occupied))[:, 1] < 0
    assert 0.2 < below.float().mean() < 0.8
    assert sorted(asked) == [int(below.sum())] * 16 + [len(below)] * 8
    raw = model.baked.density.float()
    truth = origins[:, :1].sin().expand(-1, int(below.sum()))
    torch.testing.assert_close(raw[:, below], truth, atol=1e-2, rtol=0)
    assert (raw[:, ~below] - 0.1).abs().max() < 0.05
