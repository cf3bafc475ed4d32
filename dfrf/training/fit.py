"""One `fit()` for the base and for a person: which people, which references and which rates differ.

B rays, F frames in a batch, N references.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import torch
from torch import Tensor

from dfrf import device as devices
from dfrf.checkpoint import load_resume, save_resume
from dfrf.config import TrainConfig
from dfrf.data import Identity
from dfrf.head_model import HeadModel
from dfrf.registry import method_of
from dfrf.training.augmentation import Look, draw_look
from dfrf.training.method import Maps, Method
from dfrf.training.step import step_outcome
from dfrf.training.validation import Validation
from dfrf.workers import Workers

BAD_STEPS = 10


@dataclass
class Progress:
    """How far a run is, for a bar.

    Attributes:
        step, iterations: steps done, and in all.
        loss, psnr: of the last step, PSNR in dB over its rays.
        seconds_left: at the present pace.
        samples_per_ray: of the last step.
    """

    step: int
    iterations: int
    loss: float
    psnr: float
    seconds_left: float
    samples_per_ray: float

    def within(self, done: int, iterations: int) -> Progress:
        """The same step as one of a longer run, of which `done` steps came before this one's."""
        step = done + self.step
        share = (iterations - step) / max(self.iterations - self.step, 1)
        left = self.seconds_left * share
        return replace(self, step=step, iterations=iterations, seconds_left=left)

    def __str__(self) -> str:
        left = f"{self.seconds_left:.0f} s left"
        samples = f"{self.samples_per_ray:.1f} samples a ray"
        return f"step {self.step}, loss {self.loss:.4g}, {self.psnr:.1f} dB, {samples}, {left}"


@dataclass
class Curve:
    """The loss curve: one row a step."""

    rows: list[tuple[int, float, float, float]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Spent so far."""
        return self.rows[-1][3] if self.rows else 0.0

    def add(self, step: int, loss: float, psnr: float, seconds: float) -> None:
        """Notes a step: its loss, its PSNR in dB and the seconds since the run began."""
        self.rows.append((step, loss, psnr, seconds))


class TrainingDivergedError(RuntimeError):
    """The loss was not finite for several steps on end."""


def learning_rate(step: int, config: TrainConfig) -> float:
    """Adam's rate at a step: a linear start, then half a cosine down to `final_rate`."""
    start = min(1.0, (step + 1) / max(config.warmup, 1))
    fall = 0.5 * (1 + math.cos(math.pi * min(step / max(config.iterations, 1), 1.0)))
    return config.learning_rate * start * (config.final_rate + (1 - config.final_rate) * fall)


class References:
    """Which frames a person is shown by, and their feature maps."""

    def __init__(self, method: Method[Any, Any], config: TrainConfig) -> None:
        self.method = method
        self.config = config
        self.fixed: dict[str, Maps] = {}

    def maps(
        self,
        person: Identity,
        chosen: Tensor | None,
        exclude: Tensor,
        generator: torch.Generator,
        learn: bool,
        look: Look | None = None,
    ) -> Maps | None:
        """Maps of `chosen` frames, in a look; of random frames other than `exclude` when None.

        Only maps that `learn` carry a gradient to the CNN: its backward pass costs as much as the
        rest of the step.
        """
        count = self.method.references
        if not count:
            return None
        fixed = chosen is not None and look is None and not self.config.learn_references_every
        if fixed and person.name in self.fixed:
            return self.fixed[person.name]
        frames, asked = chosen, None
        if frames is None:
            asked = exclude
            order = torch.randperm(person.frames, generator=generator)
            frames = order[~torch.isin(order, exclude)][:count]
            if frames.numel() < count:
                frames = order[:count]
        views = self.method.views(person, frames, asked)
        if look is not None:
            views = look.of_views(views)
        if learn:
            return self.method.encode(views.to(self.method.model.device))
        maps = self.method.maps(views)
        if fixed:
            self.fixed[person.name] = maps
        return maps


def fit(
    model: HeadModel,
    people: Sequence[Identity],
    config: TrainConfig,
    *,
    references: dict[str, Tensor] | None = None,
    resume: str | None = None,
    progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    device: str = "auto",
    validation: Validation | None = None,
    about: Mapping[str, Any] | None = None,
) -> Curve:
    """Trains a model of any preset on people, for the base and for a fine-tune alike.

    Args:
        model: changed in place.
        people: one of them is drawn each step.
        config: settings.
        references: fixed reference frames of each person by name; drawn anew each step when None.
        resume: folder that holds the state of an unfinished run, written as it goes.
        progress: called after every step.
        device: auto, cpu or cuda. The people stay where they are; each step's rays go there.
        stop: asked after every step; True ends the run early with its state saved.
        validation: people held out, who end the run when it no longer serves them better; holds
            the best model afterwards.
        about: what else a state in `resume` must agree in, plain data by name: who the people are
            and what the model began from.

    Returns:
        The curve of the whole run, resumed steps included.

    Raises:
        TrainingDivergedError: ten steps on end whose loss was not finite.
        dfrf.checkpoint.CheckpointError: `resume` holds the state of another run.
    """
    target = devices.choose(device)
    model.to(target)
    generator = torch.Generator().manual_seed(config.seed)
    method = method_of(model)
    optimiser = make_optimiser(method, config)
    trained = [p for group in optimiser.param_groups for p in group["params"]]
    curve = Curve()
    held = validation or Validation()
    run = model, optimiser, generator, config, curve, held, about or {}
    first = 0 if resume is None else load_resume(resume, *run)
    views = References(method, config)
    model.train()
    method.begin(people, held.people, config, generator, resumed=first > 0)
    last = first if held.over(config.patience) else config.iterations
    began, spent = time.monotonic(), curve.seconds
    bad = 0
    with Workers(target, method.side_by_side) as workers:
        for step in range(first, last):
            for group in optimiser.param_groups:
                group["lr"] = learning_rate(step, config)
            person = people[int(torch.randint(len(people), (1,), generator=generator))]
            look = draw_look(generator) if config.augment else None
            shares = method.draw(person, config, generator)
            shares = [share if look is None else look.of_share(share) for share in shares]
            shown = torch.cat([share.batch.frames for share in shares])
            chosen = references[person.name] if references is not None else None
            every = config.learn_references_every
            learn = every > 0 and step % every == 0
            maps = views.maps(person, chosen, shown, generator, learn, look)
            done = step_outcome(method, shares, maps, config, step, trained, workers)
            if torch.isfinite(done.loss):
                for parameter, gradient in zip(trained, done.gradients, strict=True):
                    parameter.grad = gradient
                torch.nn.utils.clip_grad_norm_(trained, 1.0)
                optimiser.step()
                method.learned(done)
                bad = 0
            else:
                bad += 1
                if bad >= BAD_STEPS:
                    raise TrainingDivergedError(
                        f"the loss was not finite for {bad} steps on end, up to step {step}"
                    )
            method.stepped(step, config)
            seconds = spent + time.monotonic() - began
            psnr = -10 * math.log10(max(done.mse.item(), 1e-10))
            curve.add(step, done.loss.item(), psnr, seconds)
            if progress is not None:
                pace = (time.monotonic() - began) / (step + 1 - first)
                left = pace * (config.iterations - step - 1)
                per_ray = len(done.points) / max(done.rays, 1)
                progress(
                    Progress(step + 1, config.iterations, done.loss.item(), psnr, left, per_ray)
                )
            held.measure(method, config, step + 1, workers)
            ends = held.over(config.patience) or (stop is not None and stop())
            if resume is not None and (ends or config.pauses(step + 1)):
                save_resume(resume, *run, step + 1)
            if ends:
                break
    return curve


def make_optimiser(method: Method[Any, Any], config: TrainConfig) -> torch.optim.Adam:
    """Adam over what learns from pictures; the rest is frozen."""
    model = method.model
    for name, parameter in model.named_parameters():
        parameter.requires_grad_(method.learns(name, config))
    return torch.optim.Adam(
        [p for p in model.parameters() if p.requires_grad],
        lr=config.learning_rate,
        betas=(0.9, 0.99),
        eps=1e-12,
    )
