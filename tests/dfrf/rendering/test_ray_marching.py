"""Marching and the occupancy grid, beside a loop that looks at every step."""

import torch

from dfrf.cameras import Rays
from dfrf.config import MarchConfig
from dfrf.rendering.occupancy import FADE, OPEN_WEIGHT, OccupancyGrid
from dfrf.rendering.ray_marching import Search, box_interval, march

CONFIG = MarchConfig(resolution=8, step=0.2, max_samples=5)


def rays(count: int) -> Rays:
    origins = torch.randn(count, 3) * 0.3 + torch.tensor([0.0, 0.0, 6.0])
    directions = torch.randn(count, 3) * 0.15 + torch.tensor([0.0, 0.0, -1.0])
    directions = torch.nn.functional.normalize(directions, dim=-1)
    return Rays(origins, directions, torch.zeros(count, dtype=torch.long))


def test_march_keeps_what_a_loop_keeps() -> None:
    grid = OccupancyGrid(8)
    occupied = torch.rand(8, 8, 8) < 0.4
    occupied[:2] = False
    occupied[:, :, 7] = False
    grid.start_from(occupied)
    seen = rays(40)
    origins, directions = seen.origins, seen.directions
    jitter = torch.rand(40)
    packed = march(seen, grid, CONFIG, Search(jitter))
    enter, leave = box_interval(origins, directions, *grid.bounds())
    enter = (enter / CONFIG.step).floor() * CONFIG.step
    expected = []
    for r in range(40):
        kept, step = 0, 0
        while (t := enter[r] + (step + jitter[r]) * CONFIG.step) < leave[r]:
            point = origins[r] + t * directions[r]
            index, inside = grid.cell(point)
            if inside and grid.occupied.view(-1)[index] and kept < CONFIG.max_samples:
                expected.append((r, kept, float(t)))
                kept += 1
            step += 1
    found = list(
        zip(packed.ray.tolist(), packed.slot.tolist(), packed.distance.tolist(), strict=True)
    )
    assert [f[:2] for f in found] == [e[:2] for e in expected]
    assert len(expected) > 50
    torch.testing.assert_close(
        torch.tensor([f[2] for f in found]), torch.tensor([e[2] for e in expected])
    )


def test_march_looks_no_further_than_it_may() -> None:
    grid = OccupancyGrid(8)
    grid.start_from(torch.rand(512) < 0.7)
    seen = rays(60)
    whole = march(seen, grid, CONFIG)
    distances = whole.dense(whole.distance)
    near, far = distances[:, 1], distances[:, 2]  # of each ray's second and third sample
    near = torch.where(far > 0, near, torch.inf)
    far = torch.where(far > 0, far, -torch.inf)
    part = march(seen, grid, CONFIG, Search(between=(near, far)))
    reached = far.isfinite()
    assert 20 < reached.sum() < 60
    assert part.dense(part.distance).shape[1] == 2
    torch.testing.assert_close(
        part.dense(part.distance)[reached], torch.stack([near, far], 1)[reached]
    )
    assert not (part.dense(part.distance)[~reached] > 0).any()


def test_a_total_is_the_weighted_sum_along_a_ray() -> None:
    grid = OccupancyGrid(8)
    grid.start_from(torch.rand(512) < 0.4)
    packed = march(rays(10), grid, CONFIG)
    values = torch.randn(len(packed.points), 3)
    weights = torch.rand(10, packed.slots)
    expected = (weights[..., None] * packed.dense(values)).sum(1)
    torch.testing.assert_close(packed.total(weights, values), expected)


def test_a_ray_that_misses_the_box_has_no_sample() -> None:
    grid = OccupancyGrid(8)
    missing = Rays(
        torch.tensor([[0.0, 9.0, 6.0]]), torch.tensor([[0.0, 0.0, -1.0]]), torch.zeros(1).long()
    )
    packed = march(missing, grid, CONFIG)
    assert packed.points.shape == (0, 3)
    assert packed.dense(torch.zeros(0)).shape == (1, 1)


def test_dense_puts_every_sample_at_its_place() -> None:
    grid = OccupancyGrid(8)
    grid.start_from(torch.rand(512) < 0.4)
    packed = march(rays(10), grid, CONFIG)
    dense = packed.dense(packed.distance)
    assert dense.shape == (10, packed.slots)
    torch.testing.assert_close(dense[packed.ray, packed.slot], packed.distance)
    assert (dense != 0).sum() == packed.distance.numel()


def test_a_cell_stays_open_while_weights_confirm_it_and_closes_after() -> None:
    grid = OccupancyGrid(8)
    grid.start_from(torch.zeros(512, dtype=torch.bool))
    point = grid.centres()[300:301]
    grid.observe(point, torch.tensor([0.9]))
    grid.refresh()
    where = grid.occupied.view(-1).nonzero().view(-1)
    assert 300 in where
    assert where.numel() == 7  # the cell and those that share a face with it
    rounds = 0
    while grid.occupied.any():
        grid.refresh()
        rounds += 1
        assert rounds < 50
    assert 0.9 * FADE**rounds <= OPEN_WEIGHT * 1.001


def test_the_largest_weight_of_a_cell_counts() -> None:
    grid = OccupancyGrid(8)
    grid.start_from(torch.zeros(512, dtype=torch.bool))
    point = grid.centres()[77:78].repeat(3, 1)
    grid.observe(point, torch.tensor([0.1, 0.6, 0.2]))
    grid.observe(point[:1], torch.tensor([0.3]))
    assert grid.weight.view(-1)[77] == torch.tensor(0.6)
    assert grid.weight.sum() == torch.tensor(0.6)


def test_bounds_hold_the_open_cells_and_nothing_more() -> None:
    grid = OccupancyGrid(8)
    occupied = torch.zeros(8, 8, 8, dtype=torch.bool)
    assert torch.equal(*grid_bounds(grid, occupied))
    occupied[2, 3, 7] = occupied[5, 3, 1] = True
    low, high = grid_bounds(grid, occupied)
    cell = (grid.high - grid.low) / 8
    torch.testing.assert_close(low, grid.low + cell * torch.tensor([2.0, 3.0, 1.0]))
    torch.testing.assert_close(high, grid.low + cell * torch.tensor([6.0, 4.0, 8.0]))


def grid_bounds(grid: OccupancyGrid, occupied: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    grid.start_from(occupied)
    return grid.bounds()
