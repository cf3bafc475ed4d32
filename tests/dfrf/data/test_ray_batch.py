"""Rays drawn from pictures: each has the colours of the very pixel that it goes through."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from dfrf.cameras import project
from dfrf.config import TrainConfig
from dfrf.data.dataset import EYES, HEAD, MOUTH, OUTSIDE, RIM, HeadDataset
from dfrf.data.ray_batch import draw_rays, surface_rays
from tests.dfrf.people import FOCAL, SIZE, person

FRAMES = torch.tensor([4, 1])
SHARES = {MOUTH: 0.3, EYES: 0.2, RIM: 0.1, HEAD: 0.25, OUTSIDE: 0.15}
CONFIG = TrainConfig(
    rays=4000,
    frames=2,
    mouth_share=SHARES[MOUTH],
    eyes_share=SHARES[EYES],
    rim_share=SHARES[RIM],
    outside_share=SHARES[OUTSIDE],
)


@pytest.fixture
def numbered() -> HeadDataset:
    """Pictures whose colours are their frame, row and column; backgrounds and mattes are others."""
    someone = person()
    images = torch.zeros_like(someone.images)
    grid = torch.arange(SIZE, dtype=torch.uint8)
    images[..., 0] = torch.arange(len(images), dtype=torch.uint8)[:, None, None]
    images[..., 1], images[..., 2] = grid[:, None], grid
    regions = someone.regions.clone()
    regions[:, :4] = OUTSIDE
    return replace(
        someone,
        images=images,
        backgrounds=images + 100,
        mattes=images[..., 1] + images[..., 2] + 50,
        regions=regions,
        centres=someone.centres + torch.tensor([1.5, -0.5]),
    )


def test_a_ray_goes_through_the_pixel_whose_colours_it_has(numbered: HeadDataset) -> None:
    rays = draw_rays(numbered, FRAMES, CONFIG, torch.Generator().manual_seed(0))
    frame, row, column = (rays.colour * 255).round().unbind(1)
    assert torch.equal(frame.long(), FRAMES[rays.frame])
    torch.testing.assert_close(rays.background, rays.colour + 100 / 255)
    torch.testing.assert_close(rays.matte, (row + column + 50) / 255)
    torch.testing.assert_close(rays.directions.norm(dim=1), torch.ones(len(frame)))
    for number in FRAMES.tolist():
        of = frame == number
        camera, centre = numbered.c2w[number][None], numbered.centres[number][None]
        assert torch.equal(rays.origins[of], camera[0, :, 3].expand(int(of.sum()), 3))
        (seen,) = project(rays.origins[of] + 5 * rays.directions[of], camera, FOCAL, centre)
        torch.testing.assert_close(seen, torch.stack([column, row], 1)[of], atol=1e-3, rtol=0)


def test_regions_have_their_shares(numbered: HeadDataset) -> None:
    rays = draw_rays(numbered, FRAMES, CONFIG, torch.Generator().manual_seed(0))
    frame, row, column = (rays.colour * 255).round().long().unbind(1)
    regions = numbered.regions[frame, row, column]
    assert len(regions) == CONFIG.rays
    for code, share in SHARES.items():
        assert int((regions == code).sum()) == pytest.approx(share * CONFIG.rays)


def test_a_region_without_a_share_is_drawn_with_the_head(numbered: HeadDataset) -> None:
    even = replace(CONFIG, mouth_share=0.0, eyes_share=0.0, rim_share=0.0)
    rays = draw_rays(numbered, FRAMES, even, torch.Generator().manual_seed(0))
    frame, row, column = (rays.colour * 255).round().long().unbind(1)
    regions, inside = numbered.regions[frame, row, column], numbered.regions[FRAMES] != OUTSIDE
    for code in (MOUTH, EYES, RIM, HEAD):
        part = float((numbered.regions[FRAMES] == code).sum() / inside.sum())
        share = float((regions == code).float().mean() / (1 - SHARES[OUTSIDE]))
        assert share == pytest.approx(part, abs=0.03)


def test_a_face_without_a_region_is_drawn_from_the_others(numbered: HeadDataset) -> None:
    shut = replace(numbered, regions=numbered.regions.where(numbered.regions != EYES, HEAD))
    rays = draw_rays(shut, FRAMES, CONFIG, torch.Generator().manual_seed(0))
    assert len(rays.colour) == pytest.approx((1 - SHARES[EYES]) * CONFIG.rays)
    with pytest.raises(ValueError, match="ellipsoid: the drawn frames show no head"):
        draw_rays(
            replace(shut, regions=torch.full_like(shut.regions, 99)),
            FRAMES,
            CONFIG,
            torch.Generator(),
        )


def test_rays_through_the_mean_face_end_on_it(numbered: HeadDataset) -> None:
    drawn = surface_rays(numbered, FRAMES, 10, torch.Generator().manual_seed(0))
    rays = drawn.rays
    assert rays.frame.tolist() == [0] * 10 + [1] * 10
    assert torch.equal(rays.origins, numbered.c2w[FRAMES][rays.frame][:, :, 3])
    ends = rays.origins + drawn.distance[:, None] * rays.directions
    away = (ends[:, None] - numbered.surface).norm(dim=-1).amin(1)
    assert away.max() < 1e-5
