"""What a view sees of a point: its surface, and the soft test of depth against it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
import torch
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.config import MarchConfig
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_method import FastMethod
from dfrf.field.field import FieldOutput
from dfrf.field.reference_views import HIDDEN, TOLERANCE, ReferenceViews
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.view_surfaces import nearest_around, surfaces
from dfrf.rendering.volume_rendering import Volume
from tests.dfrf.people import person, random_model

pytestmark = pytest.mark.usefixtures("arithmetic")
RADIUS = 0.8


@dataclass(frozen=True)
class Ball:
    """A solid ball round the origin."""

    def seen_from(self, origin: Float[Tensor, 3]) -> Ball:
        return self

    def __call__(
        self, points: Float[Tensor, "M 3"], directions: Tensor, frame: Int[Tensor, " M"]
    ) -> FieldOutput:
        density = torch.where(points.norm(dim=-1) < RADIUS, 200.0, 0.0)
        return FieldOutput(density, torch.zeros_like(points), points.new_zeros(0, len(points), 2))


def ball() -> Volume:
    grid = OccupancyGrid(24)
    grid.start_from(torch.ones_like(grid.occupied))
    return Volume(Ball(), grid, MarchConfig(resolution=24, step=0.02, max_samples=256))


def views() -> ReferenceViews:
    return cut_references(person(), torch.tensor([0, 2, 5]))


def test_the_surface_of_a_ball_lies_where_it_is() -> None:
    seen = surfaces(lambda _: ball(), views())
    assert len(seen) == 3
    distance = views().c2w[:, :, 3].norm(dim=-1)
    nearest = torch.stack([one[one > 0].amin() for one in seen])
    torch.testing.assert_close(nearest, distance - RADIUS, atol=0.05, rtol=0)
    assert (seen[:, [0, -1]] == 0).float().mean() > 0.5  # beside the ball there is none


def test_beside_an_edge_the_nearer_surface_counts() -> None:
    distance = torch.tensor([[[5.0, 5, 5, 7, 7, 7]]]).expand(1, 3, 6)
    assert nearest_around(distance)[0, 1].tolist() == [5, 5, 5, 5, 7, 7]
    distance = torch.tensor([[[5.0, 5, 5, 0, 0, 0]]]).expand(1, 3, 6)
    assert nearest_around(distance)[0, 1].tolist() == [5, 5, 0, 0, 0, 0]


def test_a_view_sees_the_front_and_not_the_back() -> None:
    seen = replace(views(), surface=surfaces(lambda _: ball(), views()))
    towards = seen.c2w[:, :, 3].mean(0)
    towards = towards / towards.norm()
    points = torch.stack([RADIUS * towards, -RADIUS * towards, (RADIUS - TOLERANCE) * towards])
    height, width = seen.mattes.shape[1:]
    shares = seen.project(points) / torch.tensor([width - 1, height - 1])
    front, back, tolerated = seen.log_visibility(points, shares).T
    assert (front > -0.1).all()
    assert (back == HIDDEN).all()
    assert (tolerated > -2).all()
    assert (views().log_visibility(points, shares) == 0).all()  # nothing is known


def test_a_hidden_view_gives_no_colour() -> None:
    """Of two references, the one that does not see a point has no weight."""
    model, maps = random_model()
    some, shape = maps.views, maps.views.mattes.shape[1:]
    blind = torch.stack([torch.full((4, 4), 99.0), torch.zeros(4, 4)])
    maps = replace(maps, views=replace(some, surface=blind))
    points = 0.3 * torch.randn(64, 3)
    positions = torch.rand(2, 64, 2) * (torch.tensor([shape[1], shape[0]]) - 1)
    field = model.field
    query = field.query(points, -points, torch.zeros(64, dtype=torch.long), torch.zeros(1, 70))
    with torch.no_grad():
        _, _, weight = field.aggregate(query, maps, torch.zeros(1, 70), positions)
    assert (weight[0] > 0.95).all()


def test_a_finished_person_knows_what_its_views_see() -> None:
    model, _ = random_model()
    found = FastMethod(model).finish(person(), torch.tensor([0, 5]), seed=0)
    assert found is not None
    assert found.mouths is not None
    for of, count in ((found, 2), (found.mouths.views, len(found.mouths.frames))):
        assert of.surface is not None
        assert len(of.surface) == count
        assert of.surface.isfinite().all()
