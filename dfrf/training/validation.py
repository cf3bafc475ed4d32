"""How a model in training serves people it does not learn from, and when to stop.

P people held out, B rays of each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch, draw_rays
from dfrf.field.reference_maps import ReferenceViews
from dfrf.training.method import Method
from dfrf.workers import Workers

SEED = 0


@dataclass(frozen=True)
class Exam:
    """What a model is asked of a person: rays of some frames, given references of others."""

    person: Identity
    batch: RayBatch
    views: ReferenceViews | None

    def psnr(self, method: Method[Any, Any]) -> float:
        """PSNR in dB over the rays, as the model is."""
        batch = self.batch.to(method.model.device)
        maps = None if self.views is None else method.maps(self.views)
        picture = method.picture(self.person, batch, maps)
        # A picture that is not a number is as bad as black for white, not the best of all.
        mse = F.mse_loss(picture, batch.colour).nan_to_num(nan=1.0).item()
        return -10 * math.log10(max(mse, 1e-10))


def draw_exam(person: Identity, method: Method[Any, Any], config: TrainConfig) -> Exam:
    """The same exam in every run: rays as in a step, references of frames that have none of them.

    Args:
        person: who is held out.
        method: of the model that is asked, which says how many references it is shown.
        config: how many rays and frames.
    """
    generator = torch.Generator().manual_seed(SEED)
    some = torch.randint(person.frames, (config.frames,), generator=generator)
    batch = draw_rays(person, some, config, generator)
    references = method.references
    if not references:
        return Exam(person, batch, None)
    order = torch.randperm(person.frames, generator=generator)
    others = order[~torch.isin(order, batch.frames)]
    chosen = (others if len(others) >= references else order)[:references]
    return Exam(person, batch, method.views(person, chosen, batch.frames))


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
        method: Method[Any, Any],
        config: TrainConfig,
        done: int,
        workers: Workers,
    ) -> None:
        """Notes how a model does after `done` steps, where that is due; keeps it if it is best."""
        if not self.people or not config.pauses(done):
            return
        if not self._exams:
            self._exams = [draw_exam(p, method, config) for p in self.people]
        marks = workers.map(lambda exam: exam.psnr(method), self._exams)
        self.rows.append((done, *marks))
        if self.best_row() == len(self.rows) - 1:
            kept = method.model.state_dict().items()
            self.best = {k: v.detach().cpu().clone() for k, v in kept}
