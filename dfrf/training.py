"""One `fit()` for the base and for a person: which people, which references and which rates differ.

B rays, F frames in a batch, N references.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from dfrf import device as devices
from dfrf.augmentation import Look, draw_look
from dfrf.checkpoint import load_resume, save_resume
from dfrf.config import TrainConfig
from dfrf.data import Identity, cut_references
from dfrf.lips import learn_lips, shown_codes
from dfrf.model import Model, ReferenceMaps
from dfrf.step import draw_shares, step_outcome
from dfrf.validation import Validation
from dfrf.workers import Workers

BAD_STEPS = 10
SHARES = 4  # of a step's rays on a CPU: as many cores work side by side
SPEECH = ("field.audio.", "field.attention.", "field.lips.")


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

    def __str__(self) -> str:
        left = f"{self.seconds_left:.0f} s left"
        return f"step {self.step}, loss {self.loss:.4g}, {self.psnr:.1f} dB, {left}"


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

    def __init__(self, model: Model, config: TrainConfig) -> None:
        self.model = model
        self.config = config
        self.fixed: dict[str, ReferenceMaps] = {}

    def maps(
        self,
        person: Identity,
        chosen: Tensor | None,
        exclude: Tensor,
        generator: torch.Generator,
        learn: bool,
        look: Look | None = None,
    ) -> ReferenceMaps | None:
        """Maps of `chosen` frames, in a look; of random frames other than `exclude` when None.

        Only maps that `learn` carry a gradient to the CNN: its backward pass costs as much as the
        rest of the step.
        """
        count = self.model.config.field.references
        if not count:
            return None
        fixed = chosen is not None and look is None and not self.config.learn_references_every
        if fixed and person.name in self.fixed:
            return self.fixed[person.name]
        frames = chosen
        if frames is None:
            order = torch.randperm(person.frames, generator=generator)
            frames = order[~torch.isin(order, exclude)][:count]
            if frames.numel() < count:
                frames = order[:count]
        views = cut_references(person, frames)
        if look is not None:
            views = look.of_views(views)
        views = views.to(self.model.grid.low.device)
        if learn:
            return self.model.field.encoder(views)
        with torch.no_grad():
            maps = self.model.field.encoder(views)
        maps = maps.as_type(devices.table_type(maps.table.device))
        if fixed:
            self.fixed[person.name] = maps
        return maps


def told_of(model: Model, people: Sequence[Identity]) -> dict[str, Tensor]:
    """What the field is told of every frame of each person, (T, told_dim), by name."""
    device = model.grid.low.device
    if model.config.field.use_speech:
        codes = {p.name: shown_codes(model, p) for p in people}
    else:
        codes = {p.name: torch.zeros(p.frames, model.config.field.code_dim) for p in people}
    return {p.name: torch.cat([codes[p.name].to(device), p.upper.to(device)], -1) for p in people}


def fit(
    model: Model,
    people: Sequence[Identity],
    config: TrainConfig,
    *,
    references: dict[str, Tensor] | None = None,
    resume: str | None = None,
    progress: Callable[[Progress], None] | None = None,
    stop: Callable[[], bool] | None = None,
    device: str = "auto",
    validation: Validation | None = None,
) -> Curve:
    """Trains a model on people, for the base and for a fine-tune alike.

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

    Returns:
        The curve of the whole run, resumed steps included.

    Raises:
        TrainingDivergedError: ten steps on end whose loss was not finite.
        dfrf.checkpoint.CheckpointError: `resume` holds the state of another run.
    """
    target = devices.choose(device)
    model.to(target)
    generator = torch.Generator().manual_seed(config.seed)
    optimiser = make_optimiser(model, config)
    trained = [p for group in optimiser.param_groups for p in group["params"]]
    curve = Curve()
    held = validation or Validation()
    first = 0
    if resume is not None:
        first = load_resume(resume, model, optimiser, generator, config, curve, held)
    views = References(model, config)
    model.train()
    if first == 0 and config.lip_iterations and model.config.field.use_speech:
        learn_lips(model, people, config.lip_iterations, generator)
    known = told_of(model, [*people, *held.people])
    last = first if held.over(config.patience) else config.iterations
    began, spent = time.monotonic(), curve.seconds
    bad = 0
    count = SHARES if target.type == "cpu" else 1
    with Workers(target, count) as workers:
        for step in range(first, last):
            for group in optimiser.param_groups:
                group["lr"] = learning_rate(step, config)
            person = people[int(torch.randint(len(people), (1,), generator=generator))]
            look = draw_look(generator) if config.augment else None
            shares = draw_shares(person, known[person.name], config, generator, count)
            shares = [share if look is None else look.of_share(share) for share in shares]
            shown = torch.cat([share.batch.frames for share in shares])
            chosen = references[person.name] if references is not None else None
            every = config.learn_references_every
            learn = every > 0 and step % every == 0
            maps = views.maps(person, chosen, shown, generator, learn, look)
            warp = step >= config.coarse_iterations
            done = step_outcome(model, shares, maps, config, warp, trained, workers)
            if torch.isfinite(done.loss):
                for parameter, gradient in zip(trained, done.gradients, strict=True):
                    parameter.grad = gradient
                torch.nn.utils.clip_grad_norm_(trained, 1.0)
                optimiser.step()
                model.grid.observe(done.points, done.weights)
                bad = 0
            else:
                bad += 1
                if bad >= BAD_STEPS:
                    raise TrainingDivergedError(
                        f"the loss was not finite for {bad} steps on end, up to step {step}"
                    )
            if (step + 1) % config.occupancy_every == 0:
                model.grid.refresh()
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
            held.measure(model, known, config, step + 1, workers)
            ends = held.over(config.patience) or (stop is not None and stop())
            if resume is not None and (ends or config.pauses(step + 1)):
                save_resume(resume, model, optimiser, generator, config, curve, step + 1, held)
            if ends:
                break
    return curve


def make_optimiser(model: Model, config: TrainConfig) -> torch.optim.Adam:
    """Adam over what learns from pictures; the rest is frozen."""
    for name, parameter in model.named_parameters():
        parameter.requires_grad_(learns(name, config))
    return torch.optim.Adam(
        [p for p in model.parameters() if p.requires_grad],
        lr=config.learning_rate,
        betas=(0.9, 0.99),
        eps=1e-12,
    )


def learns(name: str, config: TrainConfig) -> bool:
    """Whether pictures teach the parameter of that name: not the speech networks, see `lips`."""
    if name.startswith(SPEECH):
        return False
    return config.learn_references_every > 0 or not name.startswith("field.encoder.")
