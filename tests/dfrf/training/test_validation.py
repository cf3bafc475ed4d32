"""People held out: what serves them best is kept, and training ends when nothing is better."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from dfrf import presets
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.training.progress import Curve
from dfrf.training.validation import HeldOutRays, Validation, draw_held_out_rays
from tests.dfrf.people import person, small_config
from tests.dfrf.runs import run_fit

pytestmark = pytest.mark.medium


CONFIG = TrainConfig(
    iterations=12, coarse_iterations=2, rays=96, frames=2, occupancy_every=2, checkpoint_every=2
)


def stranger() -> HeadDataset:
    return replace(person(seed=1), name="stranger")


def run(
    validation: Validation,
    config: TrainConfig = CONFIG,
    resume: Path | None = None,
    steps: int | None = None,
) -> tuple[FastModel, Curve]:
    torch.manual_seed(1)
    model = presets.build(small_config())
    curve = run_fit(model, config, resume, steps, validation=validation)
    return model, curve


@pytest.fixture
def marks(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """PSNR that the measurements find, one after the other; to be filled in by the test."""
    given: list[float] = []
    monkeypatch.setattr(HeldOutRays, "psnr", lambda *_: given.pop(0))
    return given


def test_a_model_that_never_learned_to_warp_is_not_the_best_of_all(marks: list[float]) -> None:
    marks += [30, 29, 28, 20, 24, 23]
    held = Validation([stranger()], since=8)
    _, curve = run(held, replace(CONFIG, coarse_iterations=8, patience=2))
    assert len(curve.rows) == 12  # three worse ones in the first stage end nothing
    assert held.rows[held.best_row()] == (10, 24)
    best, _ = run(Validation(), replace(CONFIG, coarse_iterations=8), steps=10)
    assert all(torch.equal(value, held.best[name]) for name, value in best.state_dict().items())


def test_people_held_out_are_measured_with_the_codes_of_the_model_as_it_is() -> None:
    """Where pictures teach the speech networks, codes change from step to step."""
    config = small_config(lip_supervision=False, references=0, use_warp=False)
    method, held = FastMethod(presets.build(config)), stranger()
    method.begin([held], [], CONFIG, torch.Generator(), False)
    rays = draw_held_out_rays(held, method, CONFIG)
    before = rays.psnr(method)
    with torch.no_grad():
        for layer in method.model.field.conditioning.audio.parameters():
            layer.mul_(3)
    after = rays.psnr(method)
    assert after != before
    method.begin([held], [], CONFIG, torch.Generator(), False)
    assert rays.psnr(method) == pytest.approx(after, abs=1e-4)


def test_the_best_model_is_kept_and_training_ends_when_none_is_better(marks: list[float]) -> None:
    marks += [20, 25, 24, 23, 30, 30]
    held = Validation([stranger()])
    _, curve = run(held, replace(CONFIG, patience=2))
    assert len(curve.rows) == 8
    assert held.rows == [(2, 20), (4, 25), (6, 24), (8, 23)]
    assert held.best_row() == 1
    best, _ = run(Validation(), steps=4)
    assert all(torch.equal(value, held.best[name]) for name, value in best.state_dict().items())


def test_a_last_odd_step_is_measured_too(marks: list[float]) -> None:
    marks += [20, 25]
    held = Validation([stranger()])
    model, _ = run(held, replace(CONFIG, iterations=3))
    assert [row[0] for row in held.rows] == [2, 3]
    assert all(torch.equal(value, held.best[name]) for name, value in model.state_dict().items())


def test_the_mean_over_people_decides() -> None:
    held = Validation([stranger(), stranger()])
    held.rows = [(2, 20.0, 30.0), (4, 26.0, 26.0), (6, 31.0, 20.0)]
    assert held.best_row() == 1
    assert held.should_stop(1)
    assert not held.should_stop(2)
    assert not Validation(held.datasets).should_stop(1)


def test_measuring_teaches_nothing() -> None:
    held = Validation([stranger()])
    config = replace(CONFIG, iterations=4)
    found, curve = run(held, config)
    alone, other = run(Validation(), config)
    assert all(torch.equal(v, alone.state_dict()[name]) for name, v in found.state_dict().items())
    assert [row[:3] for row in curve.rows] == [row[:3] for row in other.rows]
    assert len(held.rows) == 2


@pytest.mark.parametrize("steps", [3, 5])
def test_a_resumed_run_keeps_the_same_best(
    tmp_path: Path, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The best is the second of three, before or after the pause.
    real = HeldOutRays.psnr
    plain, whole, first, second = (Validation([stranger()]) for _ in range(4))
    config = replace(CONFIG, iterations=6)
    run(plain, config)
    middle = plain.rows[1][1]
    monkeypatch.setattr(HeldOutRays, "psnr", lambda *a: -abs(real(*a) - middle))
    expected, _ = run(whole, config)
    run(first, config, tmp_path, steps=steps)
    found, curve = run(second, config, tmp_path)
    assert second.rows == whole.rows
    assert whole.best_row() == 1
    assert len(curve.rows) == 6
    assert set(second.best) == set(whole.best)
    assert all(torch.equal(value, second.best[name]) for name, value in whole.best.items())
    assert all(torch.equal(v, found.state_dict()[n]) for n, v in expected.state_dict().items())


def test_a_run_that_is_over_is_not_gone_on_with(tmp_path: Path, marks: list[float]) -> None:
    marks += [20, 19]
    config = replace(CONFIG, patience=1)
    run(Validation([stranger()]), config, tmp_path)
    again = Validation([stranger()])
    _, curve = run(again, config, tmp_path)
    assert len(curve.rows) == 4
    assert again.rows == [(2, 20), (4, 19)]


def test_an_exam_is_the_same_every_time_and_shows_none_of_its_answers() -> None:
    someone = person(frames=12)
    method = FastMethod(presets.build(small_config()))
    first, second = (draw_held_out_rays(someone, method, CONFIG) for _ in range(2))
    assert torch.equal(first.batch.origins, second.batch.origins)
    assert first.views is not None
    assert second.views is not None
    assert torch.equal(first.views.c2w, second.views.c2w)
    for pose in someone.c2w[first.batch.frames]:
        assert not (first.views.c2w == pose).flatten(1).all(1).any()


def test_an_exam_compares_the_picture_with_the_background_behind_it() -> None:
    someone = stranger()
    model = presets.build(small_config())
    model.grid.start_from(torch.zeros_like(model.grid.occupied))
    method = FastMethod(model)
    method.conditioning = {"stranger": torch.zeros(someone.frames, model.config.field.cond_dim)}
    held_out = draw_held_out_rays(someone, method, CONFIG)
    mse = float(((held_out.batch.background - held_out.batch.colour) ** 2).mean())
    assert held_out.psnr(method) == pytest.approx(-10 * math.log10(mse))


def test_a_model_that_is_not_a_number_is_the_worst() -> None:
    model = presets.build(small_config())
    with torch.no_grad():
        model.field.density.bias.fill_(float("nan"))
    someone, method = stranger(), FastMethod(model)
    method.conditioning = {"stranger": torch.zeros(someone.frames, model.config.field.cond_dim)}
    assert draw_held_out_rays(someone, method, CONFIG).psnr(method) == 0
