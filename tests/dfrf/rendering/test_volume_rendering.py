"""Packed rendering through the grid, beside dense rendering of the same field."""

import torch

from dfrf import presets
from dfrf.cameras import pixel_rays
from dfrf.rendering.ray_marching import box_interval
from dfrf.rendering.volume_rendering import render_rays
from tests.dfrf.people import FOCAL, SIZE, person, shown, small_config


def test_the_grid_changes_nothing_where_it_covers_the_density() -> None:
    model, maps = shown()
    someone = person()
    rows, columns = torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="ij")
    pixels = torch.stack([columns, rows], -1).view(-1, 2).float()
    count = pixels.shape[0]
    origins, directions = pixel_rays(
        someone.c2w[2].expand(count, 3, 4), FOCAL, someone.centres[2].expand(count, 2), pixels
    )
    directions = torch.nn.functional.normalize(directions, dim=-1)
    frame = torch.zeros(count, dtype=torch.long)
    codes = torch.randn(1, 70)
    with torch.no_grad():
        packed = render_rays(model, origins, directions, frame, codes, maps)
        # A slow dense pass: every step of every ray, one after the other.
        wide = presets.build(small_config())
        wide.load_state_dict(model.state_dict())
        wide.grid.start_from(torch.ones(wide.grid.resolution**3, dtype=torch.bool))
        light = torch.ones(count)
        colour = torch.zeros(count, 3)

        enter, leave = box_interval(origins, directions, wide.grid.low, wide.grid.high)
        step = wide.config.march.step
        for k in range(int(((leave - enter).max() / step).item()) + 2):
            t = (enter / step).floor() * step + (k + 0.5) * step
            out = wide.field(origins + t[:, None] * directions, directions, frame, codes, maps)
            alpha = (1 - torch.exp(-out.density * step)) * ((t > enter) & (t < leave))
            colour += (light * alpha)[:, None] * out.colour
            light *= 1 - alpha
    assert packed.opacity.max() > 0.95
    assert packed.samples.points.shape[0] < 0.3 * count * 30
    error = (packed.colour - colour).abs()
    # bfloat16 arithmetic and the thin density outside the open cells are all that differ.
    assert error.mean() < 0.01
    torch.testing.assert_close(packed.opacity, 1 - light, atol=0.25, rtol=0)


def test_stopping_at_opaque_rays_loses_less_than_it_may() -> None:
    model, maps = shown()
    origins = torch.tensor([0.0, 0.1, 6.0]) + 0.3 * torch.randn(300, 3)
    directions = torch.nn.functional.normalize(torch.randn(300, 3) * 0.1 - origins, dim=-1)
    frame, codes = torch.zeros(300).long(), torch.randn(1, 70)
    whole = render_rays(model, origins, directions, frame, codes, maps)
    with torch.no_grad():
        stopped = render_rays(model, origins, directions, frame, codes, maps)
    torch.testing.assert_close(stopped.opacity, whole.opacity, atol=0.008, rtol=0)
    torch.testing.assert_close(stopped.colour, whole.colour, atol=0.02, rtol=0)
    unseen = (stopped.alpha == 0) & (whole.alpha > 0.01)
    assert unseen.any()


def test_opacity_and_weights_agree() -> None:
    model, maps = shown()
    origins = torch.tensor([[0.0, 0.1, 6.0], [0.3, 0.1, 6.0]])
    directions = torch.tensor([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    seen = render_rays(model, origins, directions, torch.zeros(2).long(), torch.randn(1, 70), maps)
    torch.testing.assert_close(seen.opacity, seen.weights.sum(-1))
    assert ((seen.opacity > 0.9) & (seen.opacity <= 1.0001)).all()
    # The prior's skin is at reach 0.9: depth 6 - (0.9 * 1.05 - 0.05) = 5.1 for the middle ray.
    assert abs(float(seen.depth[0] / seen.opacity[0]) - 5.1) < 0.25
