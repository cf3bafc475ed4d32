"""One fit() for base and fine-tune: it learns, resumes bit for bit and guards against NaN."""

from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest
import torch

from dfrf import presets
from dfrf.checkpoint import CheckpointError
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.method_interface import StepOutcome
from dfrf.training.fit import FitOptions, Run, TrainingDivergedError, fit, learning_rate
from tests.dfrf.people import person, small_config
from tests.dfrf.runs import run_fit

pytestmark = pytest.mark.medium


CONFIG = TrainConfig(
    iterations=4, coarse_iterations=2, rays=96, frames=2, warmup=2, occupancy_every=2
)
REFERENCES = {"ellipsoid": torch.tensor([0, 5])}


def made(seed: int = 1) -> FastModel:
    torch.manual_seed(seed)
    return presets.build(small_config())


run = partial(run_fit, references=REFERENCES)


@pytest.mark.usefixtures("arithmetic")
@pytest.mark.parametrize("every", [0, 2])
def test_four_steps_are_two_and_resume_and_two_bit_for_bit(tmp_path: Path, every: int) -> None:
    config = replace(CONFIG, learn_references_every=every)
    whole = made()
    curve = run(whole, config)
    run(made(), config, tmp_path, steps=2)
    resumed = made(seed=7)  # whatever it holds is replaced by the state
    again = run(resumed, config, tmp_path)
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    assert [row[:3] for row in curve.rows] == [row[:3] for row in again.rows]
    assert len(again.rows) == 4


def test_a_state_of_other_settings_is_refused(tmp_path: Path) -> None:
    run(made(), CONFIG, tmp_path, steps=1)
    with pytest.raises(CheckpointError, match="other settings"):
        run(made(), replace(CONFIG, iterations=6), tmp_path)


def test_it_learns_a_head() -> None:
    """Compared with a model that does not learn, on the same rays: some are harder than others."""
    config = replace(CONFIG, iterations=40, coarse_iterations=0, rays=256)
    fidelities = [
        [row[2] for row in run(made(), replace(config, learning_rate=rate)).rows[-20:]]
        for rate in (0.0, 5e-3)
    ]
    gains = [after - before for before, after in zip(*fidelities, strict=True)]
    assert sum(gains) / len(gains) > 2  # dB


def test_the_warp_learns_in_the_second_stage_only() -> None:
    model = made()
    before = {n: p.clone() for n, p in model.field.warp.named_parameters()}
    run(model, replace(CONFIG, iterations=2))
    assert all(torch.equal(p, before[n]) for n, p in model.field.warp.named_parameters())
    run(model, replace(CONFIG, coarse_iterations=0))
    assert any(not torch.equal(p, before[n]) for n, p in model.field.warp.named_parameters())


def test_the_encoder_rests_in_a_fine_tune_and_learns_in_the_base() -> None:
    model = made()
    before = model.field.encoder.conv1.weight.clone()
    run(model, CONFIG)
    assert torch.equal(model.field.encoder.conv1.weight, before)
    run(model, replace(CONFIG, learn_references_every=1))
    assert not torch.equal(model.field.encoder.conv1.weight, before)


def test_a_loss_that_is_not_finite_stops_the_run() -> None:
    model = made()
    with torch.no_grad():
        model.field.density.bias.fill_(float("nan"))
    with pytest.raises(TrainingDivergedError, match="10 steps"):
        run(model, replace(CONFIG, iterations=20))


def test_one_bad_step_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    someone = person()
    bad = HeadDataset(
        **{**someone.__dict__, "windows": torch.full_like(someone.windows, torch.nan)}
    )
    model = made()
    before = {n: p.clone() for n, p in model.named_parameters()}
    fit(FastMethod(model), [bad], CONFIG, REFERENCES, FitOptions(device="cpu"))
    assert all(torch.equal(p, before[n]) for n, p in model.named_parameters())


def test_the_learning_rate_rises_and_then_falls_to_its_end() -> None:
    config = TrainConfig(iterations=100, warmup=10, learning_rate=1e-2, final_rate=0.1)
    rates = [learning_rate(step, config) for step in range(101)]
    assert rates[0] == pytest.approx(1e-3)
    assert max(rates) == rates[9] or max(rates) == rates[10]
    assert rates[100] == pytest.approx(1e-3)
    assert all(b <= a for a, b in pairwise(rates[10:]))


def test_a_step_of_great_gradients_is_cut_to_length_one() -> None:
    with Run(FastMethod(made()), [person()], CONFIG, REFERENCES, FitOptions(device="cpu")) as run:
        for size, length in ((100.0, 1.0), (1e-6, None)):
            gradients: list[torch.Tensor | None] = [torch.full_like(p, size) for p in run.trained]
            asked = torch.tensor(size * sum(p.numel() for p in run.trained) ** 0.5)
            loss = torch.tensor(1.0)
            outcome = StepOutcome(loss, loss, gradients, torch.zeros(0, 3), torch.zeros(0), 1)
            run.update(0, outcome)
            taken = torch.cat([p.grad.flatten() for p in run.trained if p.grad is not None]).norm()
            torch.testing.assert_close(taken, asked if length is None else torch.tensor(length))
