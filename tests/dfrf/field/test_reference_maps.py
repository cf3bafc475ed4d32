"""Which of a person's reference views are read for a frame."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf import presets
from dfrf.cameras import Rays
from dfrf.data.ray_batch import similar_frames
from dfrf.data.reference_cuts import cut_references
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.volume_rendering import render_rays
from tests.dfrf.people import person, small_config

TURNS = 12


def maps_of_many() -> ReferenceMaps:
    """Maps of all frames of a head that turns from right to left."""
    someone = person(TURNS)
    model = presets.build(small_config())
    with torch.no_grad():
        return model.field.encoder(cut_references(someone, torch.arange(TURNS)))


def origin_at(turn: float) -> Tensor:
    """Where the camera of `person` is at a frame's number, fractions included."""
    return torch.tensor([-0.4 + 0.8 * turn / (TURNS - 1), 0.0, 7.0])


def test_the_nearest_are_looked_at() -> None:
    maps = maps_of_many()
    near = maps.select_nearest_views(origin_at(4.2), 3)
    assert near.number.tolist() == [4, 5, 3]
    torch.testing.assert_close(near.views.c2w, maps.views.c2w[near.number])
    at = (torch.rand(1, 5, 2) * 20 + 5).expand(TURNS, 5, 2)
    assert near.read_bilinear(at[:3]).equal(maps.read_bilinear(at)[near.number])
    assert near.read_nearest(at[:3]).equal(maps.read_nearest(at)[near.number])
    weight = near.log_view_weight.exp()
    assert weight[0] > 0.9
    assert (weight.diff() < 0).all()


def test_as_many_as_there_are_have_equal_weights() -> None:
    maps = maps_of_many()
    assert maps.select_nearest_views(origin_at(2.0), TURNS) is maps
    assert (maps.log_view_weight == 0).all()


def test_a_head_that_does_not_turn_can_be_shown_by_any() -> None:
    maps = maps_of_many()
    maps.views.c2w[:, :, 3] = origin_at(5.0)
    assert maps.select_nearest_views(origin_at(5.0), 2).log_view_weight.equal(torch.zeros(2))


def test_nothing_jumps_where_one_reference_takes_the_place_of_another(arithmetic: float) -> None:
    maps = maps_of_many()
    model = presets.build(small_config()).eval()
    directions = F.normalize(torch.randn(200, 3) * 0.6 - origin_at(5.0), dim=-1)
    conditioning = torch.zeros(1, model.config.field.cond_dim)

    def picture(turn: float) -> tuple[set[int], Tensor]:
        origins = origin_at(turn).expand(200, 3)
        frame = torch.zeros(200, dtype=torch.long)
        looked = maps.select_nearest_views(
            origins[0], model.config.field.references
        ).number.tolist()
        with torch.no_grad():
            rays = Rays(origins, directions, frame)
            return set(looked), render_rays(model.volume(conditioning, maps), rays).colour

    before, after, further = picture(4.999), picture(5.001), picture(5.1)
    assert before[0] != after[0]
    jump, way = (after[1] - before[1]).abs().mean(), (further[1] - after[1]).abs().mean()
    assert jump < 0.1 * (way + arithmetic)


def test_frames_of_a_share_show_the_head_alike() -> None:
    someone = person(40)
    generator = torch.Generator().manual_seed(0)
    drawn = torch.stack([similar_frames(someone, 4, generator) for _ in range(200)])
    assert drawn.shape == (200, 4)
    assert len(drawn.unique()) == 40
    # A quarter of 40 frames round one of them: at the ends they lie all to one side.
    assert (drawn - drawn[:, :1]).abs().max() <= 10
    assert similar_frames(person(3), 4, generator).shape == (4,)
