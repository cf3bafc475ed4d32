"""Density that is looked up: the lattice, what it is fitted to, and rays through it."""

from itertools import pairwise
from pathlib import Path

import pytest
import torch

from dfrf import presets, saved_models
from dfrf.checkpoint import CheckpointError, read_tensors, write_tensors
from dfrf.config import MarchConfig
from dfrf.field.field import DENSITY_SCALE, FieldOutput
from dfrf.rendering import baked_density as baked
from dfrf.rendering.baked_density import BakedDensity, FrameDensity
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.ray_marching import Search
from dfrf.rendering.volume_rendering import Volume, render_rays
from tests.dfrf.people import small_config
from tests.dfrf.rendering.test_frame_renderer import camera


def ball(grid: OccupancyGrid) -> FrameDensity:
    """Density of a ball round the origin, at all lattice points."""
    points = torch.arange((grid.resolution + 1) ** 3)
    raw = (12 * (1 - baked.positions(grid, points).norm(dim=-1))).clamp(baked.EMPTY, baked.SOLID)
    return FrameDensity(grid, raw.view((grid.resolution + 1,) * 3))


class Looked:
    """A field whose density is looked up."""

    def __init__(self, density: FrameDensity) -> None:
        self.density = density

    def seen_from(self, origin: torch.Tensor) -> "Looked":
        return self

    def __call__(
        self, points: torch.Tensor, directions: torch.Tensor, frame: torch.Tensor
    ) -> FieldOutput:
        return FieldOutput(
            self.density(points), torch.ones_like(points), points[:0].new_zeros(0, len(points), 2)
        )


def test_density_between_lattice_points_is_interpolated() -> None:
    grid = OccupancyGrid(5)
    points = torch.arange(6**3)
    places = baked.positions(grid, points)
    torch.testing.assert_close(places[[0, -1]], torch.stack([grid.low, grid.high]))
    linear = places @ torch.tensor([9.0, -0.2, 0.5])
    density = FrameDensity(grid, linear.view(6, 6, 6))
    some = grid.low + torch.rand(40, 3) * (grid.high - grid.low)
    raw = some @ torch.tensor([9.0, -0.2, 0.5])
    air = raw < baked.AIR
    assert 3 < air.sum() < 30
    exact = DENSITY_SCALE * torch.nn.functional.softplus(raw)
    torch.testing.assert_close(density(some), exact.where(~air, 0), rtol=1e-4, atol=1e-4)


def test_corners_are_those_of_open_cells() -> None:
    grid = OccupancyGrid(4)
    grid.start_from(torch.arange(64) == 1 * 16 + 2 * 4 + 3)
    found = {
        tuple(int(i) for i in (p // 25, p // 5 % 5, p % 5)) for p in baked.corners(grid.occupied)
    }
    assert found == {(x, y, z) for x in (1, 2) for y in (2, 3) for z in (3, 4)}


@torch.no_grad()
@pytest.mark.parametrize("between", [False, True])
def test_rays_see_what_marching_sees(between: bool) -> None:
    config = MarchConfig(resolution=24, step=0.1, max_samples=100)
    density = ball(OccupancyGrid(config.resolution))
    rays = camera().rays(torch.arange(0, 48 * 48, 7))
    limits = torch.full((len(rays.origins),), 6.1), torch.full((len(rays.origins),), 6.6)
    search = Search(between=limits) if between else None
    opacity, depth = density.along(rays, config.step, search)
    marched = render_rays(Volume(Looked(density), density.grid, config), rays, search)
    # Marching stops where less than exp(-5) of the light is left.
    torch.testing.assert_close(opacity, marched.opacity, rtol=0, atol=0.007)
    seen = opacity > 0.5
    assert 0.05 < seen.float().mean() < 0.7
    error = (depth - marched.depth / marched.opacity)[seen].abs().max()
    assert error < config.step / 10


def test_it_follows_what_describes_a_frame_and_goes_no_further() -> None:
    grid, density = OccupancyGrid(3), BakedDensity(3)
    assert not density
    described = torch.rand(40, 2)
    points = torch.tensor([5, 21])
    slopes = torch.tensor([[2.0, 0.0], [-1.0, 3.0]])
    raw = described @ slopes - 1
    density.fit(points, described, DENSITY_SCALE * torch.nn.functional.softplus(raw))
    assert density
    found = density.of_frame(grid, torch.tensor([0.5, 0.5])).raw.view(-1)
    torch.testing.assert_close(found[points], torch.tensor([-0.5, 0.5]), rtol=0, atol=0.1)
    assert (found == baked.EMPTY).sum() == 4**3 - 2
    most = density.of_frame(grid, described.amax(0)).raw
    torch.testing.assert_close(density.of_frame(grid, torch.tensor([9.0, 9.0])).raw, most)


def test_a_frame_that_it_was_fitted_to_keeps_what_is_its_own() -> None:
    """What is not linear in the numbers: linear slopes alone would give all frames the mean."""
    described = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0])] * 2)
    raw = 1.5 * described.prod(1, keepdim=True)
    fitted = BakedDensity(2)
    points = torch.tensor([13])
    fitted.fit(points, described, DENSITY_SCALE * torch.nn.functional.softplus(raw))
    found = [float(fitted.of_frame(OccupancyGrid(2), d).raw.view(-1)[13]) for d in described]
    assert torch.corrcoef(torch.tensor([found, raw[:, 0].tolist()]))[0, 1] > 0.99
    assert max(found) > 0.7


def test_frames_to_fit_it_to_are_even_in_time_and_the_odd_ones_among_them() -> None:
    described = torch.zeros(100, 2)
    described[:, 0] = torch.linspace(0, 1, 100)
    described[[17, 61], 1] = 5.0
    chosen = baked.chosen_frames(described, 12)
    assert len(chosen) == len(set(chosen)) == 12
    assert {0, 99, 17, 61} <= set(chosen)
    assert max(b - a for a, b in pairwise(chosen)) <= 15
    assert baked.chosen_frames(described[:5], 12) == [0, 1, 2, 3, 4]


def test_it_is_saved_with_its_model_and_checked(tmp_path: Path) -> None:
    model = presets.build(small_config())
    path = tmp_path / "model.safetensors"
    saved_models.save_model(path, model)
    empty, _ = saved_models.load_model(path)
    assert not empty.baked
    points = torch.arange(7)
    model.baked.fit(points, torch.rand(9, 3), torch.rand(9, 7))
    saved_models.save_model(path, model)
    again, _ = saved_models.load_model(path)
    kept = {k: v for k, v in model.state_dict().items() if k.startswith("baked.")}
    assert len(kept) == 3
    for name, value in kept.items():
        assert torch.equal(again.state_dict()[name], value)
    tensors, header = read_tensors(path)
    old = {name: value for name, value in tensors.items() if not name.startswith("baked.")}
    write_tensors(path, old, header)
    assert not saved_models.load_model(path)[0].baked
    for wrong in (
        {"baked.described": torch.zeros(5)},
        {"baked.described": torch.zeros(5, 3)},
        {"baked.points": torch.arange(8)},
        {"baked.points": points + 25**3},
        {"baked.density": torch.full((9, 7), torch.nan).half()},
    ):
        write_tensors(path, {**tensors, **wrong}, header)
        with pytest.raises(CheckpointError):
            saved_models.load_model(path)
