"""Frames off a baked density, beside marched ones."""

from dataclasses import replace

import pytest
import torch

from dfrf.cameras import Camera
from dfrf.data.dataset import neighbour_windows
from dfrf.fast.fast_method import FastMethod
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.speaker_adaptation import CONTEXT_FRAMES
from dfrf.method_interface import FrameInputs
from dfrf.rendering.baked_frame import BLOCK, BakedHead, edge, spread
from dfrf.rendering.frame_head import MarchedHead
from dfrf.rendering.view_images import between
from tests.dfrf.people import FOCAL, SIZE, person, random_model

TIMES = 4  # as many pixels a side as the references


def learned(frames: int = 2) -> tuple[FastMethod, ReferenceMaps, FrameInputs]:
    """A baked model, its references, and inputs of a person's frames, four times as large."""
    model, _ = random_model()
    someone, method = person(), FastMethod(model)
    views = method.reference_views(someone, torch.tensor([0, 5]))
    method.finish(someone, views, 0)
    reached = torch.arange(-CONTEXT_FRAMES, frames + CONTEXT_FRAMES).clamp(0, 5)
    inputs = FrameInputs(
        someone.c2w[:frames],
        TIMES * FOCAL,
        TIMES * someone.centres[:frames],
        neighbour_windows(someone.windows, someone.segment, torch.arange(frames)),
        someone.predicted_lips[reached],
        someone.expression[:frames],
        TIMES * SIZE,
    )
    return method, method.maps(views), inputs


def decibels(some: torch.Tensor, other: torch.Tensor) -> float:
    return float(-10 * torch.log10((some - other).square().mean()))


@pytest.mark.medium
def test_a_baked_frame_is_the_marched_one_within_decibels(arithmetic: float) -> None:
    method, maps, inputs = learned()
    marched = list(method.render_frames(inputs, maps))
    baked = list(method.render_frames(replace(inputs, baked=True), maps))
    for (colour, opacity), (other, seen) in zip(marched, baked, strict=True):
        assert 0.1 < float((opacity > 0.98).float().mean()) < 0.9
        assert decibels(colour, other) > 40
        assert decibels(colour[opacity > 0.98], other[opacity > 0.98]) > 43
        assert decibels(opacity, seen) > 32
    # It is no copy: nothing but the density is the same.
    assert not torch.equal(marched[0][0], baked[0][0])
    # What lies outside of the region may be blank; inside, nothing changes.
    lower = torch.zeros(2, inputs.size, inputs.size, dtype=torch.bool)
    lower[0, inputs.size // 2 :] = True
    some = replace(inputs, baked=True, regions=lower)
    (colour, opacity), (none, nothing) = method.render_frames(some, maps)
    torch.testing.assert_close(colour[lower[0]], baked[0][0][lower[0]], rtol=0, atol=0.01)
    torch.testing.assert_close(opacity[lower[0]], baked[0][1][lower[0]], rtol=0, atol=0.01)
    assert not opacity[: inputs.size // 2 - 4 * BLOCK].any()
    assert not none.any()
    assert not nothing.any()


@pytest.mark.medium
def test_single_rays_see_what_marched_rays_see(arithmetic: float) -> None:
    method, maps, inputs = learned(1)
    camera = Camera(inputs.c2w[0], inputs.focal, inputs.centres[0], inputs.size)
    rays = camera.rays(torch.arange(0, inputs.size**2, 5))
    baked = method.resting_heads(inputs.expression, inputs.c2w[:, :, 3], maps)(0)
    assert isinstance(baked, BakedHead)
    marched = MarchedHead(baked.volume)
    with torch.no_grad():
        seen, true = baked.see(rays), marched.see(rays)
    solid = true.opacity > 0.98
    assert 0.1 < float(solid.float().mean()) < 0.9
    assert decibels(seen.opacity, true.opacity) > 30
    assert decibels(seen.colour[solid], true.colour[solid]) > 40
    assert (seen.depth - true.depth)[solid].abs().mean() < 0.04  # of a head, of radius 1
    # Where nothing is, nothing has a colour.
    assert not seen.colour[seen.opacity < 0.001].any()


@pytest.mark.medium
def test_a_model_that_was_not_baked_marches() -> None:
    model, maps = random_model()
    _, _, inputs = learned(1)
    method = FastMethod(model)
    (marched,), (asked,) = (
        list(method.render_frames(replace(inputs, baked=baked), maps)) for baked in (False, True)
    )
    assert torch.equal(marched[0], asked[0])


def test_what_is_known_spreads_to_neighbours() -> None:
    values, known = torch.zeros(1, 1, 6), torch.zeros(1, 6, dtype=torch.bool)
    values[0, 0, :3], known[0, 1:3] = torch.tensor([9.0, 2.0, 4.0]), True
    assert spread(values, known)[0, 0].tolist() == [2, 2, 4, 4, 4, 0]


def test_pixels_on_the_edge_are_those_beside_it() -> None:
    opacity = torch.tensor([1.0, 1, 1, 0.4, 0, 0, 0]).expand(7, 7)
    found = edge(opacity)
    assert found.shape == between(opacity[None])[0].shape == (25, 25)
    assert found[12].nonzero()[:, 0].tolist() == list(range(5, 20))
