"""Packed rendering through the grid, beside dense rendering of the same field."""

import torch

from dfrf import presets
from dfrf.cameras import pixel_rays
from dfrf.data import cut_references, neighbour_windows
from dfrf.marching import box_interval, march
from dfrf.model import REACH, Model
from dfrf.rendering import head_tiles, render_frames, render_rays, tile_side
from dfrf.views import ReferenceMaps
from tests.dfrf.people import FOCAL, SIZE, person, small_config


def shown() -> tuple[Model, ReferenceMaps]:
    someone = person()
    model = presets.build(small_config())
    with torch.no_grad():
        maps = model.field.encoder(cut_references(someone, torch.tensor([0, 5])))
    return model.eval(), maps


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


def test_head_tiles_hold_every_pixel_that_sees_an_open_cell() -> None:
    model, maps = shown()
    someone = person()
    found = torch.zeros(SIZE * SIZE, dtype=torch.bool)
    tiles = head_tiles(model, someone.c2w[1], FOCAL, someone.centres[1], SIZE, 2)
    assert tiles.unique().numel() == tiles.numel()
    found[tiles] = True
    assert 0.1 < found.float().mean() < 0.9
    rows, columns = torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="ij")
    pixels = torch.stack([columns, rows], -1).view(-1, 2).float()
    count = pixels.shape[0]
    origins, directions = pixel_rays(
        someone.c2w[1].expand(count, 3, 4), FOCAL, someone.centres[1].expand(count, 2), pixels
    )
    directions = torch.nn.functional.normalize(directions, dim=-1)
    with torch.no_grad():
        seen = render_rays(
            model, origins, directions, torch.zeros(count).long(), torch.randn(1, 70), maps
        )
    assert not (seen.opacity[~found] > 0).any()


def test_a_tile_lies_within_a_cell_and_shows_what_single_rays_show() -> None:
    model, _ = shown()
    someone = person()
    camera = (someone.c2w[1], 4 * FOCAL, 4 * someone.centres[1], 4 * SIZE)
    side = tile_side(model, camera[0], camera[1], camera[3])
    assert side > 1
    cell = float(((model.grid.high - model.grid.low) / model.grid.resolution).min())
    assert 8.0 * (side - 1) / 2**0.5 / camera[1] < cell  # the head is 7 away
    flat = head_tiles(model, *camera, side)[::40].flatten()
    pixels = torch.stack([flat % camera[3], flat // camera[3]], -1).float()
    count = len(pixels)
    origins, directions = pixel_rays(
        camera[0].expand(count, 3, 4), camera[1], camera[2].expand(count, 2), pixels
    )
    directions = torch.nn.functional.normalize(directions, dim=-1)
    settings = model.config.march
    alone = march(origins, directions, model.grid, settings)
    together = march(origins, directions, model.grid, settings, group=side * side)
    assert together.points.shape[0] > 500
    for mine, theirs in ((together.points, alone.points), (together.distance, alone.distance)):
        torch.testing.assert_close(together.dense(mine), alone.dense(theirs))


def test_a_frame_does_not_depend_on_the_frames_beside_it() -> None:
    model, maps = shown()
    someone = person()
    reached = torch.arange(-REACH, 3 + REACH).clamp(0, len(someone.windows) - 1)
    near = neighbour_windows(someone.windows, someone.segment, reached)
    upper = someone.upper[:3]
    cameras = (someone.c2w[:3], FOCAL, someone.centres[:3])
    together = list(render_frames(model, *cameras, near, upper, maps, SIZE))
    one = slice(1, 2)
    alone = next(
        render_frames(
            model,
            cameras[0][one],
            FOCAL,
            cameras[2][one],
            near[1 : 2 + 2 * REACH],
            upper[one],
            maps,
            SIZE,
        )
    )
    assert torch.equal(together[1][0], alone[0])
    assert torch.equal(together[1][1], alone[1])


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
