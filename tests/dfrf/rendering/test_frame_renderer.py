"""Whole frames: their tiles, and rays that are looked along only where others saw anything."""

from typing import Any

import pytest
import torch

from dfrf import device
from dfrf.cameras import pixel_rays
from dfrf.data import cut_references, neighbour_windows
from dfrf.field.model import REACH, FieldOutput, Model
from dfrf.rendering import volume_rendering as rendering
from dfrf.rendering.frame_renderer import head_tiles, render_frame, tile_side
from dfrf.rendering.ray_marching import PackedSamples, march
from dfrf.rendering.volume_rendering import evaluate, render_rays
from dfrf.training.fast_method import FastMethod
from tests.dfrf.people import FOCAL, SIZE, person, shown


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
    together = list(FastMethod(model).frames(*cameras, near, upper, maps, SIZE))
    one = slice(1, 2)
    alone = next(
        FastMethod(model).frames(
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


def test_rays_looked_along_in_part_lose_next_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model, maps = shown()
    cells = model.grid.centres()
    # A cheek and an ear, and much air before them.
    model.grid.start_from((cells.norm(dim=-1) < 1.6) & (cells[:, 0] > 0.5))
    someone, told = person(), torch.randn(1, 70)
    size, focal, centre = 4 * SIZE, 4 * FOCAL, 4 * someone.centres[1]
    c2w = someone.c2w[1]
    side = tile_side(model, c2w, focal, size)
    assert side == 8  # so there are rays between
    looked: list[int] = []

    def counted(field: Model, samples: PackedSamples, *rest: Any) -> FieldOutput:
        looked.append(len(samples.points))
        return evaluate(field, samples, *rest)

    monkeypatch.setattr(rendering, "evaluate", counted)
    colour, opacity = render_frame(model, c2w, focal, centre, told[0], maps, size)
    some = sum(looked)
    looked.clear()
    flat = head_tiles(model, c2w, focal, centre, size, side).view(-1)
    pixels = torch.stack([flat % size, flat // size], -1).float()
    count = len(flat)
    origins, directions = pixel_rays(
        c2w.expand(count, 3, 4), focal, centre.expand(count, 2), pixels
    )
    directions = torch.nn.functional.normalize(directions, dim=-1)
    with torch.no_grad():
        whole = render_rays(model, origins, directions, torch.zeros(count).long(), told, maps)
    assert some < 0.7 * sum(looked)
    assert 0.1 < (whole.opacity > 0.95).float().mean() < 0.9
    assert (opacity.view(-1)[flat] - whole.opacity).abs().mean() < 5e-3
    error = (colour.view(-1, 3)[flat] - whole.colour).square().mean()
    assert -10 * error.log10() > 45  # dB


@pytest.mark.parametrize("scale", [1, 4])
def test_a_region_shows_what_the_whole_frame_shows(
    scale: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, maps = shown()
    someone = person()
    size = scale * SIZE
    camera = (someone.c2w[1][None], scale * FOCAL, scale * someone.centres[1][None])
    near = neighbour_windows(
        someone.windows, someone.segment, torch.arange(1 - REACH, 2 + REACH).clamp(0)
    )
    region = torch.zeros(1, size, size, dtype=torch.bool)
    region[0, size // 2 : size * 7 // 8, size // 3 : size // 2 + 1] = True
    looked: list[int] = []

    def counted(field: Model, samples: PackedSamples, *rest: Any) -> FieldOutput:
        looked.append(len(samples.points))
        return evaluate(field, samples, *rest)

    monkeypatch.setattr(rendering, "evaluate", counted)

    def frame(regions: torch.Tensor | None) -> tuple[torch.Tensor, torch.Tensor, int]:
        looked.clear()
        method = FastMethod(model)
        ((colour, opacity),) = method.frames(*camera, near, someone.upper[1:2], maps, size, regions)
        return colour, opacity, sum(looked)

    colour, opacity, all_samples = frame(None)
    part, part_opacity, some_samples = frame(region)
    assert opacity[region[0]].max() > 0.5
    # Rays are worked on in other company, which moves the last bits of float32.
    torch.testing.assert_close(part[region[0]], colour[region[0]], rtol=0, atol=1e-5)
    torch.testing.assert_close(part_opacity[region[0]], opacity[region[0]], rtol=0, atol=1e-5)
    assert some_samples < 0.7 * all_samples
    nothing, nowhere, none = frame(torch.zeros_like(region))
    assert not nothing.any()
    assert not nowhere.any()
    assert none == 0


def test_weights_rounded_beforehand_give_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    model, maps = shown()
    monkeypatch.setattr(device, "has_bfloat16", lambda _: True)
    someone, told = person(), torch.randn(70)
    camera = (someone.c2w[1], FOCAL, someone.centres[1])
    maps = maps.as_type(torch.bfloat16)
    colour, opacity = render_frame(model, *camera, told, maps, SIZE)
    rounded = model.rounded()
    again, as_opaque = render_frame(rounded, *camera, told, maps, SIZE)
    assert next(rounded.field.hidden.parameters()).dtype == torch.bfloat16
    assert next(model.field.hidden.parameters()).dtype == torch.float32
    assert opacity.max() > 0.9
    assert torch.equal(again, colour)
    assert torch.equal(as_opaque, opacity)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="torch sees no GPU here")
def test_a_gpu_shows_what_a_cpu_shows() -> None:
    model, maps = shown()
    someone, told = person(), torch.randn(70)
    camera = (someone.c2w[1], FOCAL, someone.centres[1])
    colour, opacity = render_frame(model, *camera, told, maps, SIZE)
    with torch.no_grad():
        views = cut_references(someone, torch.tensor([0, 5])).to(torch.device("cuda"))
        there = model.to("cuda").field.encoder(views)
    camera = (camera[0].cuda(), FOCAL, camera[2].cuda())
    again, as_opaque = render_frame(model, *camera, told.cuda(), there, SIZE)
    assert opacity.max() > 0.9
    error = (again.cpu() - colour).square().mean()
    assert -10 * error.log10() > 40  # dB
    assert (as_opaque.cpu() - opacity).abs().mean() < 0.01
