"""The `paper` preset through the one fit() and the one renderer, with sizes made tiny."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
import torch
from torch import Tensor

from dfrf.cameras import Camera, pixel_grid, pixel_rays
from dfrf.checkpoint import CheckpointError
from dfrf.config import TrainConfig
from dfrf.data.dataset import OUTSIDE, HeadDataset, neighbour_windows
from dfrf.method_interface import FrameInputs
from dfrf.presets import method_of
from dfrf.published import paper_method
from dfrf.published.conditioned_field import EncodedReferences, PaperConfig
from dfrf.published.paper_loss import paper_loss
from dfrf.published.paper_method import PaperMethod, bounds
from dfrf.published.paper_model import PaperModel
from dfrf.saved_models import load_model, load_person, save_model, save_person
from dfrf.training.fit import FitOptions, TrainingDivergedError, fit
from dfrf.training.step import step_outcome
from dfrf.training.validation import Validation, draw_held_out_rays
from dfrf.workers import Workers
from tests.dfrf.people import FOCAL, SIZE, person
from tests.dfrf.runs import run_fit

pytestmark = pytest.mark.medium


TINY = PaperConfig(
    speech_dim=8,
    code_dim=8,
    feature_dim=6,
    cnn_width=4,
    slot_dim=8,
    width=16,
    depth=7,
    colour_width=8,
    coarse_samples=8,
    fine_samples=6,
)
CONFIG = TrainConfig(
    iterations=6,
    coarse_iterations=3,
    rays=60,
    frames=3,
    warmup=1,
    mouth_share=0.25,
    eyes_share=0.1,
    outside_share=0.2,
    learn_references_every=1,
)
REFERENCES = {"ellipsoid": torch.tensor([0, 2, 3, 5])}
CPU = torch.device("cpu")


def made(seed: int = 1, config: PaperConfig = TINY) -> PaperModel:
    """A small model whose densities are large enough to see."""
    torch.manual_seed(seed)
    model = PaperModel(config)
    with torch.no_grad():
        for network in (model.field.coarse, model.field.fine):
            network.density.weight.mul_(5)
            network.density.bias.fill_(3)
    return model


run = partial(run_fit, references=REFERENCES)


def moved(before: dict[str, Tensor], model: PaperModel) -> set[str]:
    """Parts of a model that differ from what they were."""
    now = model.state_dict()
    return {".".join(n.split(".")[:2]) for n in now if not torch.equal(now[n], before[n])}


def test_fit_lowers_the_loss() -> None:
    config = replace(
        CONFIG, iterations=50, coarse_iterations=25, rays=120, learning_rate=2e-2, final_rate=0.3
    )
    curve = run(made(), config)
    first = sum(row[2] for row in curve.rows[:5]) / 5
    last = sum(row[2] for row in curve.rows[-5:]) / 5
    assert last > first + 3  # dB
    assert sum(row[1] for row in curve.rows[-5:]) < 0.5 * sum(row[1] for row in curve.rows[:5])


@pytest.mark.parametrize("done", [1, 3, 5])
def test_six_steps_are_some_and_resume_and_the_rest_bit_for_bit(tmp_path: Path, done: int) -> None:
    whole = made()
    curve = run(whole, CONFIG)
    run(made(), CONFIG, tmp_path, steps=done)
    resumed = made(seed=7)  # whatever it holds is replaced by the state
    again = run(resumed, CONFIG, tmp_path)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    assert [row[:3] for row in curve.rows] == [row[:3] for row in again.rows]


def test_a_state_of_another_preset_is_refused(tmp_path: Path) -> None:
    run(made(), CONFIG, tmp_path, steps=1)
    other = replace(TINY, width=24)
    with pytest.raises(CheckpointError, match="other settings"):
        run(made(config=other), CONFIG, tmp_path)


def test_everything_learns_from_pictures_the_smoothing_and_the_warp_in_their_turn() -> None:
    model = made()
    parts = {"audio.convolutions", "audio.hidden", "audio.out"}
    parts |= {f"field.{name}" for name in ("encoder", "aggregation", "coarse", "fine")}
    late = {"smoothing.convolutions", "smoothing.out"}

    def learned(step: int) -> set[str]:
        """What is given a gradient at that step of nine, six of them coarse."""
        model.train()
        method = method_of(model)
        config = replace(CONFIG, iterations=9, coarse_iterations=6)
        shares = method.draw_shares(person(), config, torch.Generator().manual_seed(0))
        maps = method.encode(method.reference_views(person(), REFERENCES["ellipsoid"]))
        named = dict(model.named_parameters())
        with Workers(CPU, 1) as workers:
            done = step_outcome(method, shares, maps, config, step, [*named.values()], workers)
        return {
            ".".join(name.split(".")[:2])
            for name, gradient in zip(named, done.gradients, strict=True)
            if gradient is not None and gradient.abs().sum() > 0
        }

    assert learned(1) == parts
    assert learned(2) == parts | late
    assert learned(6) == parts | late | {"field.warp"}


def test_the_whole_model_moves_in_a_fine_tune() -> None:
    model = made()
    before = {name: value.clone() for name, value in model.state_dict().items()}
    run(model, replace(CONFIG, coarse_iterations=0))
    assert {name.split(".")[0] for name in moved(before, model)} == {"audio", "smoothing", "field"}
    assert {"field.encoder", "field.warp", "field.aggregation"} <= moved(before, model)


def test_the_gradient_is_that_of_equation_9_over_all_shares() -> None:
    # No noise and no jitter to be drawn: the same numbers by one graph over whole frames.
    someone, model = person(), made(config=replace(TINY, slot_noise=False))
    method = PaperMethod(model)
    shares = method.draw_shares(someone, CONFIG, torch.Generator().manual_seed(3))
    views = method.reference_views(someone, REFERENCES["ellipsoid"])
    parameters: list[Tensor] = [p for _, p in model.named_parameters()]
    with Workers(CPU, 1) as workers:
        found = step_outcome(method, shares, method.encode(views), CONFIG, 5, parameters, workers)
    maps, losses = method.encode(views), []
    for share in shares:
        (frame,) = share.batch.frames.tolist()
        near = neighbour_windows(someone.windows, someone.segment, torch.tensor([frame]))[0]
        c2w = torch.cat([someone.c2w[frame, :, :3], someone.c2w[frame, :, 3:] / 10], -1)
        # Back to the pixels that were drawn: the camera looks along -z.
        local = share.batch.directions @ someone.c2w[frame, :, :3]
        plane = local[:, :2] / -local[:, 2:] * torch.tensor([1.0, -1.0])
        pixels = someone.centres[frame] + FOCAL * plane
        torch.testing.assert_close(pixels, pixels.round(), atol=1e-3, rtol=0)
        colours = someone.images[frame, pixels[:, 1].round().long(), pixels[:, 0].round().long()]
        torch.testing.assert_close(share.batch.colour, colours.float() / 255)
        origins, directions = pixel_rays(c2w, FOCAL, someone.centres[frame], pixels.round())
        seen = model(
            origins,
            directions,
            0.5,  # the head is 7 units, .7 m away
            1.1,
            near,
            maps,
            share.batch.background,
            jitter=True,
            generator=torch.Generator().manual_seed(share.seed),
        )
        losses.append(paper_loss(seen, share.batch.colour, SIZE, CONFIG.warp_weight))
    loss = torch.stack(losses).mean()
    torch.testing.assert_close(found.loss, loss.detach(), atol=1e-5, rtol=1e-4)
    expected = torch.autograd.grad(loss, parameters, allow_unused=True)
    for mine, theirs in zip(found.gradients, expected, strict=True):
        assert (mine is None) == (theirs is None)
        if mine is not None and theirs is not None:
            torch.testing.assert_close(mine, theirs, atol=1e-4, rtol=1e-2)
    assert found.rays == sum(len(share.batch.frame) for share in shares)
    # Samples lie between the bounds, in head units.
    assert ((found.points[:, 2] > 7 - 11.01) & (found.points[:, 2] < 7 - 4.99)).all()


def test_a_base_draws_references_anew_and_resumes_bit_for_bit(tmp_path: Path) -> None:
    people = [person(frames=9), replace(person(frames=9, seed=1), name="other")]

    def learned(folder: Path | None, steps: int) -> PaperModel:
        model, left = made(), iter(range(steps - 1, -1, -1))
        fit(
            PaperMethod(model),
            people,
            CONFIG,
            options=FitOptions(
                resume=None if folder is None else str(folder),
                stop=lambda: next(left) == 0,
                device="cpu",
            ),
        )
        return model

    whole = learned(None, 6)
    learned(tmp_path, 2)
    for name, value in learned(tmp_path, 4).state_dict().items():
        assert torch.equal(value, whole.state_dict()[name]), name


def test_people_held_out_are_measured_by_what_the_model_says_of_their_rays() -> None:
    someone, held = person(), replace(person(seed=1), name="held")
    model, validation = made(), Validation([held])
    config = replace(CONFIG, iterations=4, checkpoint_every=2)
    options = FitOptions(device="cpu", validation=validation)
    fit(PaperMethod(model), [someone], config, REFERENCES, options)
    assert [row[0] for row in validation.rows] == [2, 4]
    assert model.training
    method = PaperMethod(model)
    held_out = draw_held_out_rays(held, method, config)
    assert held_out.psnr(method) == pytest.approx(validation.rows[1][1])
    assert held_out.views is not None
    maps, one = method.maps(held_out.views), int(held_out.batch.frames[1])
    seen = method.render_batch(held, held_out.batch, maps)
    near = neighbour_windows(held.windows, held.segment, torch.tensor([one]))[0]
    model.eval()
    colour, opacity = method.render_frame(
        Camera(held.c2w[one], FOCAL, held.centres[one], SIZE), near, maps
    )
    rays = held_out.batch.frame == 1
    local = held_out.batch.directions[rays] @ held.c2w[one, :, :3]
    plane = local[:, :2] / -local[:, 2:] * torch.tensor([1.0, -1.0])
    column, row = (held.centres[one] + FOCAL * plane).round().long().unbind(-1)
    over = colour[row, column] + (1 - opacity[row, column, None]) * held_out.batch.background[rays]
    torch.testing.assert_close(seen[rays], over, atol=1e-3, rtol=0)


def test_rays_fall_inside_and_outside_of_the_head() -> None:
    someone = person()
    far = torch.zeros_like(someone.regions, dtype=torch.bool)
    far[:, :, :4] = True
    regions = torch.where(far, OUTSIDE, someone.regions).to(torch.uint8)
    marked = torch.where(far[..., None], 7, someone.images).to(torch.uint8)
    someone = replace(someone, regions=regions, images=marked)
    shares = method_of(made()).draw_shares(someone, CONFIG, torch.Generator().manual_seed(0))
    assert [share.batch.frames.numel() for share in shares] == [1, 1, 1]
    for share in shares:
        outside = (share.batch.colour * 255).round().eq(7).all(-1)
        assert int(outside.sum()) == 4  # a fifth of 20
        assert share.batch.matte[~outside].any()
    assert len({share.seed for share in shares}) == 3


def test_a_rendered_frame_is_what_the_model_says_of_all_its_pixels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    someone, model = person(), made()
    monkeypatch.setattr(paper_method, "RAYS_AT_ONCE", 700)  # 2304 rays: the last part is shorter
    method = PaperMethod(model.train())
    maps = method.maps(method.reference_views(someone, REFERENCES["ellipsoid"]))
    heard = neighbour_windows(someone.windows, someone.segment, torch.tensor([1, 4]))
    numbers = torch.tensor([1, 4])
    inputs = FrameInputs(
        someone.c2w[numbers],
        FOCAL,
        someone.centres[numbers],
        heard,
        someone.predicted_lips[numbers],
        someone.expression[numbers],
        SIZE,
    )
    frames = list(method.render_frames(inputs, maps))
    for k, (colour, opacity) in zip(numbers.tolist(), frames, strict=True):
        c2w = someone.c2w[k].clone()
        c2w[:, 3] /= 10
        pixels = pixel_grid(SIZE, SIZE).view(-1, 2)
        origins, directions = pixel_rays(c2w, FOCAL, someone.centres[k], pixels)
        near = heard[numbers.tolist().index(k)]
        with torch.no_grad():
            behind = torch.rand(SIZE * SIZE, 3)
            whole = model(origins, directions, 0.5, 1.1, near, maps, behind)
        close = partial(torch.testing.assert_close, atol=1e-5, rtol=1e-4)
        close(colour.view(-1, 3), whole["head"])
        close(opacity.view(-1), whole["opacity"])
        over = colour.view(-1, 3) + (1 - opacity.view(-1, 1)) * behind
        close(over, whole["colour"])
    assert 0.05 < frames[0][1].mean() < 1
    assert not torch.allclose(frames[0][0], frames[1][0], atol=1e-3)
    regions = torch.rand(2, SIZE, SIZE) < 0.3
    some = method.render_frames(replace(inputs, regions=regions), maps)
    for region, whole_frame, part in zip(regions, frames, some, strict=True):
        for mine, theirs in zip(part, whole_frame, strict=True):
            close(mine[region], theirs[region])
            assert not mine[~region].any()
    with pytest.raises(ValueError, match="no lip measures"):
        next(iter(method.render_frames(replace(inputs, strength=torch.full((2,), 0.5)), maps)))


def test_frames_and_chunks_of_rays_share_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    someone, model = person(), made()
    method = PaperMethod(model)
    maps = method.maps(method.reference_views(someone, REFERENCES["ellipsoid"]))
    numbers = torch.tensor([1, 4, 1])
    inputs = FrameInputs(
        someone.c2w[numbers],
        FOCAL,
        someone.centres[numbers],
        neighbour_windows(someone.windows, someone.segment, numbers),
        someone.predicted_lips[numbers],
        someone.expression[numbers],
        SIZE,
    )
    noise: list[Tensor] = []
    monkeypatch.setattr(paper_method, "PARTS_AT_ONCE", 1)  # threads would take turns at random
    model.field.aggregation.register_forward_pre_hook(lambda _, given: noise.append(given[2]))
    colours = []
    for rays in (300, 700):
        monkeypatch.setattr(paper_method, "RAYS_AT_ONCE", rays)
        colours.append(torch.stack([colour for colour, _ in method.render_frames(inputs, maps)]))
    torch.testing.assert_close(*colours, atol=1e-5, rtol=1e-4)
    assert torch.equal(colours[0][0], colours[0][2])
    assert len(noise) == 3 * 2 * (8 + 4)  # frames, passes, chunks
    for turn, one in enumerate(noise):
        samples = 13 if turn % 2 else 7  # of the coarse pass, then of both
        shared = made(seed=turn).field.aggregation.rendering_noise(samples)
        assert torch.equal(
            one.view(-1, samples, 2, 8), shared.expand(len(one) // samples, -1, -1, -1)
        )


def test_bounds_go_with_the_head() -> None:
    camera = torch.eye(3, 4)
    camera[:, 3] = torch.tensor([0.5, -0.3, 6.0])  # beside the axis: depths count along it
    assert bounds(camera) == pytest.approx((0.4, 1.0))


def test_references_are_whole_pictures_encoded_one_by_one() -> None:
    someone, model = person(), made()
    method = PaperMethod(model)
    views = method.reference_views(someone, REFERENCES["ellipsoid"])
    assert torch.equal(views.images, someone.images[REFERENCES["ellipsoid"]])
    maps = method.encode(views)
    assert isinstance(maps, EncodedReferences)
    assert maps.features.requires_grad
    together = model.field.encoder(views.images / 255, views.c2w[:, :, 3] / 10)
    torch.testing.assert_close(maps.features, together)


def test_a_model_and_a_person_come_back_from_their_files(tmp_path: Path) -> None:
    someone, model = person(), made()
    save_model(tmp_path / "base.safetensors", model, {"speech": "mel"})
    base, header = load_model(tmp_path / "base.safetensors")
    assert isinstance(base, PaperModel)
    assert (base.config, header["speech"]) == (TINY, "mel")
    method = PaperMethod(model)
    views = method.reference_views(someone, REFERENCES["ellipsoid"])
    save_person(tmp_path / "person.safetensors", model, views, {"steps": 3})
    again, kept, _ = load_person(tmp_path / "person.safetensors")
    assert kept is not None
    for name, value in model.state_dict().items():
        assert torch.equal(value, base.state_dict()[name])
        assert torch.equal(value, again.state_dict()[name])
    before, after = method.maps(views), method_of(again).maps(kept)
    assert torch.equal(before.features, after.features)


def test_a_loss_that_is_not_finite_stops_the_run() -> None:
    someone, model = person(), made()
    bad = HeadDataset(
        **{**someone.__dict__, "windows": torch.full_like(someone.windows, torch.nan)}
    )
    before = {name: value.clone() for name, value in model.state_dict().items()}
    config = replace(CONFIG, iterations=20)
    with pytest.raises(TrainingDivergedError, match="10 steps"):
        fit(PaperMethod(model), [bad], config, REFERENCES, FitOptions(device="cpu"))
    assert not moved(before, model)
