"""A person augmented: what rays see and what references show change together."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from dfrf import presets
from dfrf.cameras import project
from dfrf.config import TrainConfig
from dfrf.data.reference_cuts import cut_references
from dfrf.field.reference_views import ReferenceViews
from dfrf.published.references import bilinear
from dfrf.training import augmentation
from dfrf.training.augmentation import Augmentation, draw_augmentation
from dfrf.training.ray_share import RayShare, draw_shares
from tests.dfrf.people import SIZE, person, small_config
from tests.dfrf.runs import run_fit

pytestmark = pytest.mark.medium


PLAIN = Augmentation(False, 1.0, torch.eye(3), 1.0, (0, 0, 0, 0))
CONFIG = TrainConfig(rays=192, frames=4)
POINTS = torch.tensor([[0.3, 0.2, 0.6], [-0.5, 0.4, 0.3], [0.1, -0.6, 0.5]])


@pytest.fixture
def views() -> ReferenceViews:
    """Two references whose cameras turn, tilt and are off the middle."""
    someone = person()
    centres = someone.centres + torch.tensor([1.5, -0.5])
    angle = torch.tensor(0.2)
    turn = torch.tensor(
        [[angle.cos(), 0, angle.sin()], [0, 1, 0], [-angle.sin(), 0, angle.cos()]]
    ) @ torch.tensor([[1, 0, 0], [0, 0.96, -0.28], [0, 0.28, 0.96]])
    c2w = someone.c2w.clone()
    c2w[:, :, :3], c2w[:, :, 3] = turn, c2w[:, :, 3] @ turn.T
    return cut_references(replace(someone, centres=centres, c2w=c2w), torch.tensor([1, 4]))


@pytest.fixture
def share() -> RayShare:
    someone = person()
    known = torch.arange(someone.frames * 10.0).view(-1, 10)
    generator = torch.Generator().manual_seed(3)
    return draw_shares(someone, known, CONFIG, generator, 1)[0]


def seen(views: ReferenceViews, points: Tensor) -> Tensor:
    """(N, P, 4) colour and matte that the references show where points project."""
    maps = torch.cat([views.images, views.mattes[..., None]], -1).float() / 255
    return bilinear(maps, project(points, views.c2w, views.focal, views.centres))


def test_a_mirrored_point_is_seen_at_the_mirrored_pixel(views: ReferenceViews) -> None:
    mirrored = replace(PLAIN, mirrored=True).of_views(views)
    before = project(POINTS, views.c2w, views.focal, views.centres)
    after = project(augmentation.mirror(POINTS), mirrored.c2w, mirrored.focal, mirrored.centres)
    width = views.images.shape[2]
    expected = torch.stack([width - 1 - before[..., 0], before[..., 1]], -1)
    torch.testing.assert_close(after, expected, atol=1e-4, rtol=0)
    shown = seen(mirrored, augmentation.mirror(POINTS))
    torch.testing.assert_close(shown, seen(views, POINTS), atol=1e-3, rtol=0)
    rotation = mirrored.c2w[:, :, :3]
    torch.testing.assert_close(rotation.transpose(1, 2) @ rotation, torch.eye(3).expand(2, 3, 3))
    assert torch.allclose(torch.linalg.det(rotation), torch.ones(2))


def test_mirrored_rays_are_those_of_mirrored_pictures() -> None:
    someone = person()
    share = draw_shares(someone, torch.zeros(6, 10), CONFIG, torch.Generator().manual_seed(3), 1)[0]
    found = replace(PLAIN, mirrored=True).of_share(share).batch
    whole = ReferenceViews(
        someone.images, someone.mattes, someone.c2w, someone.focal, someone.centres, 1.0
    )
    flipped = augmentation.mirrored_views(whole)
    other = replace(someone, images=flipped.images, c2w=flipped.c2w, centres=flipped.centres)
    # The pixel each mirrored ray goes through, in the flipped picture, has the ray's colour.
    number = found.frames[found.frame]
    at = project(found.origins + 5 * found.directions, other.c2w, other.focal, other.centres)
    pixel = at[number, torch.arange(len(number))]
    torch.testing.assert_close(pixel, pixel.round(), atol=1e-3, rtol=0)
    column, row = pixel.round().long().unbind(-1)
    assert torch.equal(other.images[number, row, column].float() / 255, found.colour)
    assert column.min() >= 0
    assert column.max() < SIZE


def test_a_mirrored_person_looks_the_other_way_and_says_the_same(share: RayShare) -> None:
    conditioning = replace(PLAIN, mirrored=True).of_share(share).conditioning
    assert torch.equal(conditioning[:, :4], share.conditioning[:, :4])
    lids, brows, right, down = (
        share.conditioning[:, 4:6],
        share.conditioning[:, 6:8],
        *share.conditioning[:, 8:].T,
    )
    expected = torch.cat([lids.flip(1), brows.flip(1), -right[:, None], down[:, None]], 1)
    assert torch.equal(conditioning[:, 4:], expected)


def test_rays_through_the_face_meet_its_mirrored_points(share: RayShare) -> None:
    rays, distance = share.surface.rays, share.surface.distance
    found = replace(PLAIN, mirrored=True).of_share(share).surface
    met = found.rays.origins + found.distance[:, None] * found.rays.directions
    expected = augmentation.mirror(rays.origins + distance[:, None] * rays.directions)
    torch.testing.assert_close(met, expected)


def test_rays_and_references_are_in_the_same_light(views: ReferenceViews, share: RayShare) -> None:
    changed = draw_augmentation(torch.Generator().manual_seed(1))
    changed = replace(PLAIN, gamma=changed.gamma, mixing=changed.mixing)
    assert not torch.allclose(changed.mixing, torch.eye(3), atol=0.02)
    assert torch.equal(changed.of_views(views).images, changed.colour(views.images))
    lit = changed.of_share(share).batch
    for before, after in (
        (share.batch.colour, lit.colour),
        (share.batch.background, lit.background),
    ):
        seen_as = changed.colour((before * 255).round().to(torch.uint8))
        assert torch.equal((after * 255).round().to(torch.uint8), seen_as)
        expected = (before.pow(changed.gamma) @ changed.mixing.T).clamp(0, 1)
        torch.testing.assert_close(after, expected, atol=0.51 / 255, rtol=0)
    assert torch.equal(lit.matte, share.batch.matte)


@pytest.mark.parametrize("scale", [0.8, 0.93, 1.25])
def test_a_resized_reference_shows_a_point_the_same(views: ReferenceViews, scale: float) -> None:
    height, width = 40, 44
    column, row = torch.arange(width)[None].float(), torch.arange(height)[:, None].float()
    ramp = torch.stack([5 * column + 0 * row, 5 * row + 0 * column, 2 * (row + column)], -1)
    smooth = replace(
        views,
        images=ramp.expand(2, -1, -1, -1).to(torch.uint8),
        mattes=torch.full((2, height, width), 255, dtype=torch.uint8),
    )
    after = replace(PLAIN, scale=scale).of_views(smooth)
    assert after.images.shape[1:3] == (int(height * scale), int(width * scale))
    assert after.scale == pytest.approx(views.scale * scale)
    # A tenth of a pixel is half a step of the ramp.
    torch.testing.assert_close(seen(after, POINTS), seen(smooth, POINTS), atol=0.7 / 255, rtol=0)


def test_what_is_cut_off_is_missing_and_the_rest_stays(views: ReferenceViews) -> None:
    after = replace(PLAIN, cuts=(0.1, 0.2, 0.0, 0.1)).of_views(views)
    height, width = views.mattes.shape[1:]
    left, top, bottom = round(0.1 * width), round(0.2 * height), round(0.1 * height)
    assert torch.equal(after.images, views.images[:, top : height - bottom, left:])
    torch.testing.assert_close(
        project(POINTS, after.c2w, after.focal, after.centres),
        project(POINTS, views.c2w, views.focal, views.centres) - torch.tensor([left, top]),
    )


def test_the_plain_look_changes_nothing(views: ReferenceViews, share: RayShare) -> None:
    after = PLAIN.of_views(views)
    assert torch.equal(after.images, views.images)
    assert torch.equal(after.mattes, views.mattes)
    torch.testing.assert_close(PLAIN.of_share(share).batch.colour, share.batch.colour)


def test_looks_are_drawn_from_the_generator_and_stay_within_bounds() -> None:
    first, second = (torch.Generator().manual_seed(5) for _ in range(2))
    drawn = [draw_augmentation(first) for _ in range(300)]
    again = [draw_augmentation(second) for _ in range(300)]
    assert all(
        torch.equal(a.mixing, b.mixing) and replace(a, mixing=b.mixing) == b
        for a, b in zip(drawn, again, strict=True)
    )
    assert torch.equal(first.get_state(), second.get_state())
    assert 100 < sum(changed.mirrored for changed in drawn) < 200
    assert 40 < sum(any(changed.cuts) for changed in drawn) < 110
    assert all(0.8 <= changed.scale <= 1.25 for changed in drawn)
    brightness = torch.stack([changed.mixing.sum(1).mean().log() for changed in drawn])
    assert brightness.abs().max() < augmentation.GAIN + augmentation.TINT
    assert brightness.mean().abs() < 0.05
    grey = torch.full((3,), 128, dtype=torch.uint8)
    assert max(changed.colour(grey).float().std() for changed in drawn) < 16


def test_a_run_in_changing_looks_resumes_bit_for_bit(tmp_path: Path) -> None:
    config = replace(
        CONFIG, iterations=4, coarse_iterations=2, augment=True, learn_references_every=2
    )

    def run(resume: Path | None, steps: int) -> dict[str, Tensor]:
        torch.manual_seed(1)
        model = presets.build(small_config())
        run_fit(model, config, resume, steps)
        return model.state_dict()

    whole = run(None, 4)
    run(tmp_path, 2)
    for name, value in run(tmp_path, 2).items():
        assert torch.equal(value, whole[name]), name
