from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from dfrf.cameras import pixel_rays
from dfrf.config import TrainConfig
from dfrf.field.encodings import frequency_encoding
from dfrf.published import radiance_field as field
from dfrf.published.conditioned_field import EncodedReferences, PaperConfig, References
from dfrf.published.paper_loss import paper_loss
from dfrf.published.paper_model import PaperModel

pytestmark = pytest.mark.medium

NEAR, FAR = 0.5, 1.1
WHOLE = PaperConfig()
NO_WARP = replace(WHOLE, use_warp=False)
NO_REFERENCES = replace(NO_WARP, use_references=False)
NO_SPEECH = replace(NO_REFERENCES, use_speech=False)
TINY = {
    "speech_dim": 5,
    "code_dim": 8,
    "feature_dim": 6,
    "cnn_width": 4,
    "slot_dim": 8,
    "width": 16,
    "depth": 7,
    "colour_width": 8,
    "coarse_samples": 6,
    "fine_samples": 5,
}


def tiny(sizes: PaperConfig = WHOLE) -> PaperModel:
    """A model made small, with densities and offsets large enough to see."""
    torch.manual_seed(1)
    config: PaperConfig = replace(sizes, **TINY)  # type: ignore[arg-type]
    model = PaperModel(config).eval()
    with torch.no_grad():
        for network in (model.field.coarse, model.field.fine):
            network.density.weight.mul_(5)
            network.density.bias.fill_(3)
        if config.use_warp:
            for parameter in model.field.warp.parameters():
                parameter.copy_(0.2 * torch.randn_like(parameter))
    return model


def references(count: int = 4) -> References:
    c2w = torch.eye(3, 4).repeat(count, 1, 1)
    c2w[:, 2, 3] = 0.8
    c2w[:, 0, 3] = torch.linspace(-0.1, 0.1, count)
    return References(torch.rand(count, 12, 12, 3), c2w, 20.0, torch.tensor([[6.0, 6.0]]))


def frame(rays: int = 7) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Origins, directions, windows and backgrounds of some rays."""
    c2w = torch.eye(3, 4)
    c2w[2, 3] = 0.8
    pixels = torch.rand(rays, 2) * 12
    origins, directions = pixel_rays(c2w, 20.0, torch.tensor([6.0, 6.0]), pixels)
    return origins, directions, torch.randn(8, 16, 5), torch.rand(rays, 3)


def test_parts_and_sizes_with_some_left_out() -> None:
    def parameters(module: nn.Module) -> int:
        return sum(p.numel() for p in module.parameters())

    # Live parameters of the published model: 1,957,487 less two dead layers of 65,792.
    assert parameters(PaperModel()) == 1_957_487 - 2 * 65_792
    no_references = PaperModel(NO_REFERENCES)
    assert {name for name, _ in no_references.named_children()} == {"field", "audio", "smoothing"}
    assert {name for name, _ in no_references.field.named_children()} == {"coarse", "fine"}
    assert no_references.field.coarse.layers[0].weight.shape == (256, 63 + 64)
    silent = PaperModel(NO_SPEECH)
    assert {name for name, _ in silent.named_children()} == {"field"}
    assert silent.field.coarse.layers[0].weight.shape == (256, 63)
    no_warp = PaperModel(NO_WARP)
    assert parameters(no_warp) == parameters(PaperModel()) - 36_962


@pytest.mark.parametrize("sizes", [WHOLE, NO_WARP, NO_REFERENCES, NO_SPEECH])
def test_renders_and_learns(sizes: PaperConfig) -> None:
    model = tiny(sizes)
    o, d, windows, background = frame()
    seen = model(o, d, NEAR, FAR, windows, references(), background)
    assert seen["colour"].shape == (7, 3)
    assert seen["coarse_weights"].shape == (7, 5)
    assert seen["weights"].shape == (7, 10)
    assert seen["offset"].shape[-1] == 2
    behind = (1 - seen["opacity"])[:, None] * background
    torch.testing.assert_close(seen["colour"], seen["head"] + behind)
    assert 0.05 < seen["opacity"].mean() < 1
    paper_loss(seen, torch.rand(7, 3), size=12, warp_weight=1e-3).backward()
    for name, parameter in model.named_parameters():
        assert parameter.grad is not None, name
        # What all queries have in common is the same for both slots, who compete for shares.
        if not name.endswith(("query.bias", "norm_slots.bias")):
            assert parameter.grad.abs().sum() > 0, name


def test_a_few_steps_of_training_bring_the_picture_closer() -> None:
    model, views = tiny().train(), references()
    o, d, windows, background = frame(32)
    target = torch.tensor([0.8, 0.3, 0.1]).expand(32, 3)
    optimiser = torch.optim.Adam(model.parameters(), lr=5e-3)
    curve = []
    for _ in range(40):
        seen = model(o, d, NEAR, FAR, windows, views, background, jitter=True)
        loss = paper_loss(seen, target, size=12, warp_weight=TrainConfig().warp_weight)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        curve.append(loss.item())
    assert curve[-1] < 0.3 * curve[0]


def test_against_a_loop_over_samples() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame(3)
    seen = model(o, d, NEAR, FAR, windows, views, background)
    code, maps = model.speech_code(windows), model.encode(views)
    for r in range(3):
        depths = torch.cat([seen["depths"][r], torch.tensor([FAR])])
        light, colour = torch.tensor(1.0), torch.zeros(3)
        for s in range(10):
            point = o[r] + depths[s] * d[r]
            encoded = frequency_encoding(point[None], 10)
            tokens, _ = model.field.look_up(point[None], encoded, code, maps)
            noise = model.field.aggregation.rendering_noise(10)[s : s + 1]
            feature = model.field.aggregation(tokens, encoded, noise)
            inputs = torch.cat([feature, encoded, code[None]], -1)
            view = frequency_encoding(F.normalize(d[r], dim=-1)[None], 4)
            raw, sigma = model.field.fine(inputs, view)
            length = (depths[s + 1] - depths[s]) * d[r].norm()
            alpha = 1 - torch.exp(-field.density(sigma[0]) * length)
            torch.testing.assert_close(seen["alpha"][r, s], alpha)
            colour = colour + light * alpha * raw[0].sigmoid()
            light = light * (1 - alpha)
        torch.testing.assert_close(seen["colour"][r], colour + light * background[r])
        torch.testing.assert_close(seen["opacity"][r], 1 - light)


def test_look_up_reads_where_the_warp_points() -> None:
    model, views = tiny(), references()
    rows, columns = torch.meshgrid(torch.arange(12.0), torch.arange(12.0), indexing="ij")
    ramp = torch.stack([columns, rows, *torch.rand(4, 12, 12)], -1).expand(4, -1, -1, -1)
    points = torch.tensor([[0.02, -0.05, 0.01], [0.1, 0.07, 0.1], [4.0, 4.0, 0.0]])
    encoded = frequency_encoding(points, 10)
    tokens, offset = model.field.look_up(
        points, encoded, torch.randn(8), EncodedReferences(ramp, views)
    )
    for n in range(4):
        for m in range(3):
            x, y, z = (points[m] - views.c2w[n, :, 3]).tolist()
            column = round(min(max(6 - 20 * x / z, 0), 11))
            row = round(min(max(6 + 20 * y / z, 0), 11))
            place = offset[n, m] + torch.tensor([column, row])
            place = place.clamp(0, 11)
            # The ramp shows where it was read; the last two are that pixel, row first, cut off.
            torch.testing.assert_close(tokens[n, m, :2], place)
            torch.testing.assert_close(tokens[n, m, -2:], place.flip(0).trunc())
    assert offset.abs().max() > 0.01


def test_the_warp_learns_but_does_not_teach() -> None:
    model, views = tiny(), references()
    maps = EncodedReferences(model.encode(views).features.detach().requires_grad_(), views)
    points, code = 0.1 * torch.randn(9, 3), torch.randn(8, requires_grad=True)
    _, offset = model.field.look_up(points, frequency_encoding(points, 10), code, maps)
    offset.square().sum().backward()
    assert code.grad is None
    assert maps.features.grad is None
    assert model.field.warp.out.weight.grad is not None


def test_coarse_stage_is_equation_2() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame()
    plain = model(o, d, NEAR, FAR, windows, views, background, warp=False)
    assert plain["offset"].abs().max() == 0
    full = model(o, d, NEAR, FAR, windows, views, background)
    assert full["offset"].abs().max() > 0
    assert not torch.allclose(plain["colour"], full["colour"])
    without = PaperModel(replace(model.config, use_warp=False)).eval()
    without.load_state_dict(model.state_dict(), strict=False)
    same = without(o, d, NEAR, FAR, windows, views, background)
    torch.testing.assert_close(same["colour"], plain["colour"])


@pytest.mark.parametrize("count", [1, 2, 4, 6])
def test_any_number_of_references_in_any_order(count: int) -> None:
    model, views = tiny(), references(count)
    o, d, windows, background = frame()
    order = torch.arange(count).flip(0)
    turned = replace(views, images=views.images[order], c2w=views.c2w[order])
    seen = model(o, d, NEAR, FAR, windows, views, background)
    other = model(o, d, NEAR, FAR, windows, turned, background)
    torch.testing.assert_close(seen["colour"], other["colour"])


def test_features_made_once_give_the_same_picture() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame()
    seen = model(o, d, NEAR, FAR, windows, views, background)
    again = model(o, d, NEAR, FAR, windows, model.encode(views), background)
    assert torch.equal(seen["colour"], again["colour"])


def test_training_is_random_and_rendering_is_not() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame()

    def render(seed: int) -> Tensor:
        generator = torch.Generator().manual_seed(seed)
        jitter = model.training
        return model(
            o, d, NEAR, FAR, windows, views, background, jitter=jitter, generator=generator
        )["colour"]

    assert torch.equal(render(0), render(1))
    model.train()
    assert torch.equal(render(0), render(0))
    assert not torch.equal(render(0), render(1))


def test_training_takes_twice_the_samples() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame()
    made = [model(o, d, NEAR, FAR, windows, views, background, jitter=j) for j in (False, True)]
    for name in ("coarse_depths", "depths"):  # the background's sample is none of them
        rendered, trained = (out[name].shape[1] + 1 for out in made)
        assert trained == 2 * rendered


@pytest.mark.parametrize("layer", ["query", "key"])
def test_what_slots_ask_and_references_answer_matters_in_rendering(layer: str) -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame(32)
    with torch.no_grad():  # references that differ, and a picture that tells
        for part in (model.field.aggregation.value, model.field.fine.colour):
            part.weight.mul_(10)
    seen = model(o, d, NEAR, FAR, windows, views, background)["colour"]
    torch.nn.init.normal_(getattr(model.field.aggregation, layer).weight)
    other = model(o, d, NEAR, FAR, windows, views, background)["colour"]
    assert (seen - other).abs().max() > 1e-3


def test_the_background_never_enters_the_head() -> None:
    model, views = tiny(), references()
    o, d, windows, background = frame()
    seen = model(o, d, NEAR, FAR, windows, views, background)
    other = model(o, d, NEAR, FAR, windows, views, 1 - background)
    assert torch.equal(seen["head"], other["head"])
    assert torch.equal(seen["opacity"], other["opacity"])


def test_offsets_count_in_pixels_at_512() -> None:
    seen = {
        "colour": torch.zeros(2, 3),
        "coarse_colour": torch.zeros(2, 3),
        "offset": torch.tensor([0.3, 0.4]).expand(4, 2, 5, 2),
        "alpha": torch.full((2, 5), 0.25),
    }
    # Length 0.5 at 64 pixels is 4 at 512.
    loss = paper_loss(seen, torch.zeros(2, 3), size=64, warp_weight=1.0)
    torch.testing.assert_close(loss, torch.tensor(0.75 * 4))


def test_missing_inputs_are_named() -> None:
    model = tiny()
    o, d, windows, background = frame()
    with pytest.raises(ValueError, match="references"):
        model(o, d, NEAR, FAR, windows, None, background)
    with pytest.raises(ValueError, match="windows"):
        model(o, d, NEAR, FAR, None, references(), background)
    silent = tiny(NO_SPEECH)
    assert silent(o, d, NEAR, FAR, None, None, background)["offset"].numel() == 0


def test_own_code_is_that_of_the_middle_frame() -> None:
    model = tiny()
    windows = torch.randn(8, 16, 5)
    torch.testing.assert_close(model.speech_code(windows, smooth=False), model.audio(windows[4]))
