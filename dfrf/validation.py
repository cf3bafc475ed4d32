"""How a model in training serves people it does not learn from, and when to stop.

P people held out, B rays of each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf import device as devices
from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch, cut_references, draw_rays
from dfrf.model import Model, ReferenceViews
from dfrf.rendering import render_rays
from dfrf.workers import Workers

SEED = 0


@dataclass(frozen=True)
class Exam:
    """What a model is asked of one person: rays of some frames, given references of others."""

    batch: RayBatch
    views: ReferenceViews | None

    def psnr(self, model: Model, told: Tensor) -> float:
        """PSNR in dB over the rays, as the model is, told (F, told_dim) of their frames."""
        device = told.device
        batch = self.batch.to(device)
        with torch.no_grad():
            maps = None
            if self.views is not None:
                maps = model.field.encoder(self.views.to(device))
                maps = maps.as_type(devices.table_type(device))
            seen = render_rays(model, batch.origins, batch.directions, batch.frame, told, maps)
        picture = seen.colour + (1 - seen.opacity[:, None]) * batch.background
        # A picture that is not a number is as bad as black for white, not the best of all.
        mse = F.mse_loss(picture, batch.colour).nan_to_num(nan=1.0).item()
        return -10 * math.log10(max(mse, 1e-10))


def draw_exam(person: Identity, references: int, config: TrainConfig) -> Exam:
    """The same exam in every run: rays as in a step, references of frames that have none of them.

    Args:
        person: who is held out.
        references: how many frames the model is shown.
        config: how many rays and frames.
    """
    generator = torch.Generator().manual_seed(SEED)
    batch = draw_rays(person, config, generator)
    if not references:
        return Exam(batch, None)
    order = torch.randperm(person.frames, generator=generator)
    others = order[~torch.isin(order, batch.frames)]
    chosen = (others if len(others) >= references else order)[:references]
    return Exam(batch, cut_references(person, chosen))


class Validation:
    """Measures a model on people held out, and keeps the best one.

    Args:
        people: who is held out; nobody is measured on nobody.

    Attributes:
        rows: step and PSNR in dB of each person, 1 + P numbers for each measurement.
        best: weights of the best model by the mean PSNR.
    """

    def __init__(self, people: Sequence[Identity] = ()) -> None:
        self.people = people
        self.rows: list[tuple[float, ...]] = []
        self.best: dict[str, Tensor] = {}
        self._exams: list[Exam] = []

    @property
    def names(self) -> list[str]:
        """Of the people, in their order."""
        return [p.name for p in self.people]

    def best_row(self) -> int:
        """Which measurement has the highest mean; the first of equals."""
        means = [sum(row[1:]) for row in self.rows]
        return means.index(max(means))

    def over(self, patience: int) -> bool:
        """Whether the last `patience` measurements brought nothing better."""
        return bool(self.rows) and len(self.rows) - 1 - self.best_row() >= patience

    def measure(
        self,
        model: Model,
        known: dict[str, Tensor],
        config: TrainConfig,
        done: int,
        workers: Workers,
    ) -> None:
        """Notes how a model does after `done` steps, where that is due, and keeps it if it is best.

        Args:
            known: what the field is told of every frame of each person, (T, told_dim), by name.
        """
        if not self.people or not config.pauses(done):
            return
        if not self._exams:
            count = model.config.field.references
            self._exams = [draw_exam(p, count, config) for p in self.people]

        def mark(k: int) -> float:
            told = known[self.people[k].name]
            frames = self._exams[k].batch.frames.to(told.device)
            return self._exams[k].psnr(model, told[frames])

        self.rows.append((done, *workers.map(mark, range(len(self.people)))))
        if self.best_row() == len(self.rows) - 1:
            self.best = {k: v.detach().cpu().clone() for k, v in model.state_dict().items()}
