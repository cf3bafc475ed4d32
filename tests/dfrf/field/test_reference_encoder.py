"""What a view shows beside the head says nothing of the head."""

from __future__ import annotations

from dataclasses import replace

import torch

from dfrf import presets
from dfrf.data.reference_cuts import cut_references
from dfrf.field.query import FieldQuery
from dfrf.field.reference_encoder import BILINEAR_SPREAD, MATTE, sharpened, shows_head
from dubbing.identity.sharpness import gradient_energy
from tests.dfrf.people import person, small_config

VIEWS, POINTS = 4, 30


@torch.no_grad()
def test_a_view_that_shows_the_wall_at_a_point_gives_no_colour(arithmetic: float) -> None:
    someone, model = person(VIEWS), presets.build(small_config()).eval()
    maps = model.field.encoder(cut_references(someone, torch.arange(VIEWS)))
    table = maps.features.clone()
    table[:, MATTE] = 1.0
    wall = slice(maps.height * maps.width)  # the first view's pixels
    table[wall, MATTE] = 0.0
    conditioning = torch.zeros(1, model.config.field.cond_dim)
    points, frame = torch.zeros(POINTS, 3), torch.zeros(POINTS).long()
    directions = torch.tensor([0.0, 0.0, -1.0]).expand(POINTS, 3)
    positions = (torch.rand(1, POINTS, 2) * 15 + 5).expand(VIEWS, POINTS, 2)
    query: FieldQuery = model.field.query(points, directions, frame, conditioning)
    _, _, weight = model.field.aggregate(
        query, replace(maps, features=table), conditioning, positions
    )
    assert weight[0].max() < 0.05
    assert weight[1:].min() > 0.1
    assert arithmetic > 0


def test_where_every_view_shows_the_wall_all_count_alike() -> None:
    shown = shows_head(torch.zeros(VIEWS, POINTS))
    assert (shown == shown[0, 0]).all()
    assert shown[0, 0] > 0


def test_a_ripple_is_higher_by_as_much_as_the_kernel_says() -> None:
    wave = 0.5 + 0.2 * torch.sin(torch.arange(32) * torch.pi / 2)
    colour = wave[None, None, :, None].expand(1, 32, 32, 3)
    sharp = sharpened(colour)
    # Of a wave four pixels long the kernel (-s/2, 1 + s, -s/2) makes one 1 + s times as high.
    inner = (0, slice(2, -2), slice(2, -2))
    torch.testing.assert_close(sharp[inner] - 0.5, (1 + BILINEAR_SPREAD) * (colour[inner] - 0.5))
    assert gradient_energy(sharp[0]) > 1.2 * gradient_energy(colour[0])


def test_an_even_colour_stays_as_it_is_up_to_the_border() -> None:
    even = torch.tensor([0.8, 0.5, 0.4]).expand(1, 8, 8, 3)
    torch.testing.assert_close(sharpened(even), even)
