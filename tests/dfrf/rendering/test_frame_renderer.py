"""Whole frames: what they cover, and pixels that are filled in from those around."""

from dataclasses import replace
from typing import Any

import pytest
import torch

from dfrf import device
from dfrf.cameras import Camera
from dfrf.data.dataset import neighbour_windows
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_method import FastMethod
from dfrf.field.field import FieldOutput
from dfrf.field.speaker_adaptation import CONTEXT_FRAMES
from dfrf.method_interface import FrameInputs
from dfrf.rendering import volume_rendering as rendering
from dfrf.rendering.frame_renderer import BLOCK, head_blocks, render_frame
from dfrf.rendering.ray_marching import PackedSamples
from dfrf.rendering.volume_rendering import PointField, evaluate, render_rays
from tests.dfrf.people import FOCAL, SIZE, person, random_model

pytestmark = pytest.mark.medium


def camera(times: int = 1) -> Camera:
    """The camera of a frame, with so many times as many pixels a side."""
    someone = person()
    return Camera(someone.c2w[1], times * FOCAL, times * someone.centres[1], times * SIZE)


def pixels_of(blocks: torch.Tensor, size: int) -> torch.Tensor:
    """Pixels (size, size) that lie in blocks."""
    return blocks.repeat_interleave(BLOCK, 0).repeat_interleave(BLOCK, 1)[:size, :size]


@pytest.mark.parametrize("size", [SIZE, SIZE - 3])
def test_blocks_hold_every_pixel_that_sees_an_open_cell(size: int) -> None:
    model, maps = random_model()
    cells = model.grid.centres()
    model.grid.start_from((cells.norm(dim=-1) < 1.2) & (cells[:, 0] > 0.3))
    view = replace(camera(), size=size)
    found = pixels_of(head_blocks(model.grid, view), size)
    assert 0.1 < found.float().mean() < 0.9
    rays = view.rays(torch.arange(size * size))
    with torch.no_grad():
        seen = render_rays(model.volume(torch.randn(1, 70), maps), rays)
    assert seen.opacity.max() > 0.5
    assert not (seen.opacity.view(size, size)[~found] > 0).any()


def test_a_camera_inside_the_head_sees_what_lies_before_it_and_one_beyond_it_nothing() -> None:
    model, _ = random_model()
    inside, beyond = camera(), camera()
    for view, at in ((inside, 0.0), (beyond, -9.0)):
        view.c2w[:, 3] = at * view.c2w[:, 2]
    blocks = head_blocks(model.grid, inside)
    assert blocks.any()
    assert not head_blocks(model.grid, beyond).any()


def test_a_frame_does_not_depend_on_the_frames_beside_it(arithmetic: float) -> None:
    model, maps = random_model()
    someone = person()
    reached = torch.arange(-CONTEXT_FRAMES, 3 + CONTEXT_FRAMES).clamp(0, len(someone.windows) - 1)
    near = neighbour_windows(someone.windows, someone.segment, torch.arange(3))
    predicted = someone.predicted_lips[reached]
    method = FastMethod(model)

    def inputs(first: int, stop: int) -> FrameInputs:
        return FrameInputs(
            someone.c2w[first:stop],
            FOCAL,
            someone.centres[first:stop],
            near[first:stop],
            predicted[first : stop + 2 * CONTEXT_FRAMES],
            someone.expression[first:stop],
            SIZE,
        )

    together = list(method.render_frames(inputs(0, 3), maps))
    alone = next(method.render_frames(inputs(1, 2), maps))
    # Products over another number of frames differ in their last bits: what they give, and a
    # colour that is made of it, may each be rounded the other way.
    most = max(1e-4, 2 * arithmetic)
    for one, other in zip(together[1], alone, strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=most)


@pytest.mark.usefixtures("arithmetic")
def test_pixels_on_a_smooth_surface_are_filled_in_and_lose_next_to_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model, maps = random_model()
    cells = model.grid.centres()
    # A cheek and an ear, and much air before them.
    model.grid.start_from((cells.norm(dim=-1) < 1.6) & (cells[:, 0] > 0.5))
    large = camera(4)
    volume = model.volume(torch.randn(1, 70), maps)
    looked: list[int] = []

    def counted(field: PointField, samples: PackedSamples, *rest: Any) -> FieldOutput:
        looked.append(len(samples.points))
        return evaluate(field, samples, *rest)

    monkeypatch.setattr(rendering, "evaluate", counted)
    colour, opacity = render_frame(volume, large)
    some = sum(looked)
    looked.clear()
    flat = pixels_of(head_blocks(model.grid, large), large.size).flatten().nonzero()[:, 0]
    with torch.no_grad():
        whole = render_rays(volume, large.rays(flat))
    assert some < 0.5 * sum(looked)
    assert 0.1 < (whole.opacity > 0.95).float().mean() < 0.9
    assert (opacity.view(-1)[flat] - whole.opacity).abs().mean() < 5e-3
    error = (colour.view(-1, 3)[flat] - whole.colour).square().mean()
    assert -10 * error.log10() > 45  # dB


@pytest.mark.parametrize("scale", [1, 4])
def test_a_region_shows_what_the_whole_frame_shows(
    scale: int, arithmetic: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, maps = random_model()
    someone = person()
    size = scale * SIZE
    around = torch.arange(1 - CONTEXT_FRAMES, 2 + CONTEXT_FRAMES).clamp(0, len(someone.windows) - 1)
    speech = (
        neighbour_windows(someone.windows, someone.segment, torch.tensor([1])),
        someone.predicted_lips[around],
    )
    camera = (someone.c2w[1][None], scale * FOCAL, scale * someone.centres[1][None])
    region = torch.zeros(1, size, size, dtype=torch.bool)
    region[0, size // 2 : size * 7 // 8, size // 3 : size // 2 + 1] = True
    looked: list[int] = []

    def counted(field: PointField, samples: PackedSamples, *rest: Any) -> FieldOutput:
        looked.append(len(samples.points))
        return evaluate(field, samples, *rest)

    monkeypatch.setattr(rendering, "evaluate", counted)

    def frame(regions: torch.Tensor | None) -> tuple[torch.Tensor, torch.Tensor, int]:
        looked.clear()
        inputs = FrameInputs(*camera, *speech, someone.expression[1:2], size, regions)
        ((colour, opacity),) = FastMethod(model).render_frames(inputs, maps)
        return colour, opacity, sum(looked)

    colour, opacity, all_samples = frame(None)
    part, part_opacity, some_samples = frame(region)
    assert opacity[region[0]].max() > 0.5
    # Rays are worked on in other company, which moves the last bits of products.
    most = max(1e-5, 2 * arithmetic)
    torch.testing.assert_close(part[region[0]], colour[region[0]], rtol=0, atol=most)
    torch.testing.assert_close(part_opacity[region[0]], opacity[region[0]], rtol=0, atol=most)
    assert some_samples < 0.7 * all_samples
    nothing, nowhere, none = frame(torch.zeros_like(region))
    assert not nothing.any()
    assert not nowhere.any()
    assert none == 0


def test_weights_rounded_beforehand_give_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    model, maps = random_model()
    monkeypatch.setattr(device, "has_bfloat16", lambda _: True)
    conditioning = torch.randn(1, 70)
    maps = maps.as_type(torch.bfloat16)
    colour, opacity = render_frame(model.volume(conditioning, maps), camera())
    rounded = model.rounded()
    again, as_opaque = render_frame(rounded.volume(conditioning, maps), camera())
    assert next(rounded.field.hidden.parameters()).dtype == torch.bfloat16
    assert next(model.field.hidden.parameters()).dtype == torch.float32
    assert opacity.max() > 0.9
    assert torch.equal(again, colour)
    assert torch.equal(as_opaque, opacity)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="torch sees no GPU here")
def test_a_gpu_shows_what_a_cpu_shows() -> None:
    model, maps = random_model()
    someone, conditioning, here = person(), torch.randn(1, 70), camera()
    colour, opacity = render_frame(model.volume(conditioning, maps), here)
    with torch.no_grad():
        views = cut_references(someone, torch.tensor([0, 5])).to(torch.device("cuda"))
        there = model.to("cuda").field.encoder(views)
    moved = Camera(here.c2w.cuda(), here.focal, here.centre.cuda(), here.size)
    again, as_opaque = render_frame(model.volume(conditioning.cuda(), there), moved)
    assert opacity.max() > 0.9
    error = (again.cpu() - colour).square().mean()
    assert -10 * error.log10() > 40  # dB
    assert (as_opaque.cpu() - opacity).abs().mean() < 0.01
