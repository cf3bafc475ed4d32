"""`fit()` trains a base and fine-tunes a person: only people, references and settings differ.

B rays, F frames in a batch, N references.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import torch
from torch import Tensor

from dfrf import device as devices
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.method_interface import Maps, Method, Share, StepOutcome
from dfrf.training.augmentation import draw_augmentation
from dfrf.training.progress import Curve, TrainingProgress
from dfrf.training.reference_source import ReferenceSource
from dfrf.training.run_state import RunState
from dfrf.training.share_processes import ShareProcesses, can_fork, share_state
from dfrf.training.step import step_outcome, total
from dfrf.training.validation import Validation
from dfrf.workers import Workers

ATTENTION = "smoothing."  # parameters of the attention over neighbouring speech codes
BAD_STEPS = 10  # in a row with a loss that is not finite, which end a run


@dataclass(frozen=True)
class FitOptions:
    """How a run is saved, reported and ended; nothing here changes what a step computes.

    Attributes:
        resume: folder for the state of an unfinished run, read at the start and written on the way.
        progress: called after every step.
        stop: called after every step; True ends the run early with its state saved.
        device: auto, cpu or cuda. The datasets stay where they are; each step's rays go there.
        validation: measures people held out, and ends the run when they no longer improve; holds
            the best model afterwards.
        about: more settings that a state in `resume` must agree in, plain data by name: who the
            people are, and the weights that the model started from.
    """

    resume: str | None = None
    progress: Callable[[TrainingProgress], None] | None = None
    stop: Callable[[], bool] | None = None
    device: str = "auto"
    validation: Validation | None = None
    about: Mapping[str, Any] = field(default_factory=dict)


class TrainingDivergedError(RuntimeError):
    """The loss was not finite for several steps in a row."""


def learning_rate(step: int, config: TrainConfig) -> float:
    """Adam's rate at a step: a linear start, then half a cosine, or a constant factor a step."""
    start = min(1.0, (step + 1) / max(config.warmup, 1))
    done, end = min(step / max(config.iterations, 1), 1.0), config.final_rate
    fall = 0.5 * (1 + math.cos(math.pi * done))
    share = end + (1 - end) * fall if config.adam.cosine else end**done
    return config.learning_rate * start * share


def make_optimiser(method: Method[Any, Any], config: TrainConfig) -> torch.optim.Adam:
    """Adam over the parameters that are trained on images; the others are frozen."""
    model, adam = method.model, config.adam
    groups: dict[float, list[Tensor]] = {}  # by their rate, times the others'
    for name, parameter in model.named_parameters():
        parameter.requires_grad_(method.learns(name, config))
        if parameter.requires_grad:
            rate = adam.attention_rate if name.startswith(ATTENTION) else 1.0
            groups.setdefault(rate, []).append(parameter)
    return torch.optim.Adam(
        [{"params": parameters, "rate": rate} for rate, parameters in groups.items()],
        lr=config.learning_rate,
        betas=(0.9, adam.beta),
        eps=adam.epsilon,
    )


def fit(
    method: Method[Any, Any],
    datasets: Sequence[HeadDataset],
    config: TrainConfig,
    references: dict[str, Tensor] | None = None,
    options: FitOptions | None = None,
) -> Curve:
    """Trains a model of any preset on people, for the base and for a fine-tune alike.

    Args:
        method: of the model, which is changed in place.
        datasets: of the people; one of them is drawn each step.
        config: settings.
        references: fixed reference frames of each person by name; drawn anew each step when None.
        options: how the run is kept, watched and ended.

    Returns:
        The curve of the whole run, resumed steps included.

    Raises:
        TrainingDivergedError: ten steps in a row whose loss was not finite.
        dfrf.checkpoint.CheckpointError: `resume` holds the state of another run.
    """
    with Run(method, datasets, config, references, options or FitOptions()) as run:
        for step in run.steps():
            outcome = run.outcome(step)
            run.update(step, outcome)
            run.report(step, outcome)
            run.state.validation.measure(method, config, step + 1, run.workers)
            if run.ends_after(step):
                break
    return run.state.curve


class Run(ExitStack):
    """A run of `fit`: its state, and what happens in a step.

    Attributes:
        state: everything that a resumed run needs.
        trained: the parameters that are optimised.
        workers: threads of this process.
    """

    def __init__(
        self,
        method: Method[Any, Any],
        datasets: Sequence[HeadDataset],
        config: TrainConfig,
        references: dict[str, Tensor] | None,
        options: FitOptions,
    ) -> None:
        super().__init__()
        self.method, self.datasets = method, datasets
        self.config, self.options = config, options
        model = method.model.to(devices.choose(options.device))
        self.state = RunState(
            model,
            make_optimiser(method, config),
            torch.Generator().manual_seed(config.seed),
            Curve(),
            options.validation or Validation(),
            config,
            options.about,
        )
        self.trained = [p for g in self.state.optimiser.param_groups for p in g["params"]]
        self.first = 0 if options.resume is None else self.state.load(options.resume)
        self.references = ReferenceSource(method, config, references)
        self.workers = self.enter_context(Workers(model.device, method.parallel_shares))
        self.processes: ShareProcesses[Share, StepOutcome] | None = None
        self.bad_steps = 0
        self.began, self.spent = time.monotonic(), self.state.curve.seconds

    def steps(self) -> range:
        """Prepares the run, and returns the steps that are left."""
        self.method.model.train()
        held = self.state.validation
        self.method.begin(
            self.datasets, held.datasets, self.config, self.state.generator, self.first > 0
        )
        self.began = time.monotonic()
        stop = held.should_stop(self.config.patience)
        return range(self.first, self.first if stop else self.config.iterations)

    def draw(self, step: int) -> tuple[list[Share], Maps | None]:
        """Sample a person, rays and references."""
        generator = self.state.generator
        chosen = int(torch.randint(len(self.datasets), (1,), generator=generator))
        dataset = self.datasets[chosen]
        augmentation = draw_augmentation(generator) if self.config.augment else None
        shares = self.method.draw_shares(dataset, self.config, generator)
        if augmentation is not None:
            shares = [augmentation.of_share(share) for share in shares]
        drawn = torch.cat([share.batch.frames for share in shares])
        return shares, self.references.maps(dataset, drawn, generator, step, augmentation)

    def outcome(self, step: int) -> StepOutcome:
        """Loss and gradients of a step."""
        shares, maps = self.draw(step)
        if step == self.first and self.workers.count > 1 and self._forks():
            share_state(self.state.model)
            work = partial(self._share_outcome, maps)
            self.processes = self.enter_context(ShareProcesses(work, self.workers.count - 1))
        if self.processes is not None:
            return total(self.processes.outcomes(step, shares))
        return step_outcome(
            self.method, shares, maps, self.config, step, self.trained, self.workers
        )

    def _forks(self) -> bool:
        """Whether shares are computed in forks: only the model's state may change between steps."""
        if not can_fork(self.state.model.device):
            return False
        return len(self.datasets) == 1 and self.references.is_constant

    def _share_outcome(self, maps: Maps | None, step: int, share: Share) -> StepOutcome:
        return self.method.share_outcome(share, maps, self.config, step, self.trained)

    def update(self, step: int, outcome: StepOutcome) -> None:
        """Takes a step of the optimiser where the loss is finite.

        Raises:
            TrainingDivergedError: it was not, ten times in a row.
        """
        if torch.isfinite(outcome.loss):
            for group in self.state.optimiser.param_groups:
                group["lr"] = group["rate"] * learning_rate(step, self.config)
            for parameter, gradient in zip(self.trained, outcome.gradients, strict=True):
                parameter.grad = gradient
            if longest := self.config.adam.longest:
                torch.nn.utils.clip_grad_norm_(self.trained, longest)
            self.state.optimiser.step()
            self.method.after_update(outcome)
            self.bad_steps = 0
        else:
            self.bad_steps += 1
            if self.bad_steps >= BAD_STEPS:
                raise TrainingDivergedError(
                    f"the loss was not finite for {self.bad_steps} steps in a row, to step {step}"
                )
        self.method.after_step(step, self.config)

    def report(self, step: int, outcome: StepOutcome) -> None:
        """Adds a step to the curve, and reports the progress."""
        spent = time.monotonic() - self.began
        loss, psnr = outcome.loss.item(), -10 * math.log10(max(outcome.mse.item(), 1e-10))
        self.state.curve.add(step, loss, psnr, self.spent + spent)
        if self.options.progress is not None:
            pace = spent / (step + 1 - self.first)
            per_ray = len(outcome.points) / max(outcome.rays, 1)
            self.options.progress(
                TrainingProgress(step + 1, self.config.iterations, loss, psnr, pace, per_ray)
            )

    def ends_after(self, step: int) -> bool:
        """Whether a step was the last; saves the state where that is due."""
        options = self.options
        ends = self.state.validation.should_stop(self.config.patience)
        ends = ends or (options.stop is not None and options.stop())
        if options.resume is not None and (ends or self.config.checkpoint_due(step + 1)):
            self.state.save(options.resume, step + 1)
        return ends
