"""Packed rendering through the grid, beside dense rendering of the same field."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from dfrf import device
from dfrf.cameras import Camera, Rays
from dfrf.rendering.ray_marching import box_interval
from dfrf.rendering.volume_rendering import OPAQUE, RayColours, Volume, render_rays
from tests.dfrf.people import FOCAL, SIZE, person, random_model

pytestmark = pytest.mark.usefixtures("arithmetic")


def apart(arithmetic: float) -> float:
    """How far two ways to the same light may differ: by 1e-3 in float32, and twice rounded.

    Samples are worked on in other company, which moves the last bits of products, and so the way
    in which a number is rounded: that of the density, that of the colour.
    """
    return 1e-3 + 2 * arithmetic


@pytest.fixture
def volume() -> Iterator[Volume]:
    """A head whose cells are all open and whose rays keep all samples."""
    model, maps = random_model()
    model.grid.start_from(torch.ones_like(model.grid.occupied))
    march = replace(model.config.march, max_samples=64)
    with torch.no_grad():
        yield replace(model.volume(torch.randn(1, 70), maps), march=march)


@pytest.fixture
def rays() -> Rays:
    someone = person()
    camera = Camera(someone.c2w[2], FOCAL, someone.centres[2], SIZE)
    return camera.rays(torch.arange(SIZE * SIZE))


def dense(volume: Volume, rays: Rays) -> tuple[Tensor, Tensor]:
    """Colour and opacity by a slow loop: every step of every ray through the box."""
    grid, step = volume.grid, volume.march.step
    field = volume.field.seen_from(rays.origins.mean(0))
    enter, leave = box_interval(rays.origins, rays.directions, grid.low, grid.high)
    light, colour = torch.ones(len(enter)), torch.zeros(len(enter), 3)
    for k in range(int(((leave - enter).max() / step).item()) + 2):
        t = (enter / step).floor() * step + (k + 0.5) * step
        with device.arithmetic(t.device):
            out = field(rays.origins + t[:, None] * rays.directions, rays.directions, rays.frame)
        alpha = (1 - torch.exp(-out.density * step)) * ((t > enter) & (t < leave))
        colour += (light * alpha)[:, None] * out.colour
        light *= 1 - alpha
    return colour, 1 - light


@torch.enable_grad()  # a gradient is wanted: no ray is given up where it is opaque
def packed(volume: Volume, rays: Rays) -> RayColours:
    return render_rays(volume, rays)


def test_packed_is_dense(volume: Volume, rays: Rays, arithmetic: float) -> None:
    colour, opacity = dense(volume, rays)
    seen = packed(volume, rays)
    assert 0.1 < (opacity > 0.95).float().mean() < 0.9
    torch.testing.assert_close(seen.colour, colour, atol=apart(arithmetic), rtol=0)
    torch.testing.assert_close(seen.opacity, opacity, atol=apart(arithmetic), rtol=0)


def test_closed_cells_without_weight_change_nothing(
    volume: Volume, rays: Rays, arithmetic: float
) -> None:
    colour, opacity = dense(volume, rays)
    whole, grid = packed(volume, rays), volume.grid
    samples = whole.samples
    grid.weight.zero_()
    grid.observe(samples.points, whole.weights[samples.ray, samples.slot].detach())
    grid.start_from(grid.weight > 1e-5)
    assert grid.occupied.float().mean() < 0.4
    seen = packed(volume, rays)
    assert len(seen.samples.points) < 0.5 * len(samples.points)
    torch.testing.assert_close(seen.colour, colour, atol=apart(arithmetic), rtol=0)
    torch.testing.assert_close(seen.opacity, opacity, atol=apart(arithmetic), rtol=0)


def test_stopping_at_opaque_rays_loses_less_than_it_may(arithmetic: float) -> None:
    model, maps = random_model()
    origins = torch.tensor([0.0, 0.1, 6.0]) + 0.3 * torch.randn(300, 3)
    directions = torch.nn.functional.normalize(torch.randn(300, 3) * 0.1 - origins, dim=-1)
    rays = Rays(origins, directions, torch.zeros(300).long())
    volume = model.volume(torch.randn(1, 70), maps)
    whole = render_rays(volume, rays)
    with torch.no_grad():
        stopped = render_rays(volume, rays)
    most = math.exp(-OPAQUE) + apart(arithmetic)
    torch.testing.assert_close(stopped.opacity, whole.opacity, atol=most, rtol=0)
    torch.testing.assert_close(stopped.colour, whole.colour, atol=most, rtol=0)
    unseen = (stopped.alpha == 0) & (whole.alpha > 0.01)
    assert unseen.any()


def test_opacity_and_weights_agree() -> None:
    model, maps = random_model()
    origins = torch.tensor([[0.0, 0.1, 6.0], [0.3, 0.1, 6.0]])
    directions = torch.tensor([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    rays = Rays(origins, directions, torch.zeros(2).long())
    seen = render_rays(model.volume(torch.randn(1, 70), maps), rays)
    torch.testing.assert_close(seen.opacity, seen.weights.sum(-1))
    assert ((seen.opacity > 0.9) & (seen.opacity <= 1.0001)).all()
    # The prior's skin is at reach 0.9: depth 6 - (0.9 * 1.05 - 0.05) = 5.1 for the middle ray.
    assert abs(float((seen.depth[0] / seen.opacity[0]).detach()) - 5.1) < 0.25
