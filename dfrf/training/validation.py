"""Validation on held-out people while a model is trained, and early stopping.

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
from dfrf.data.dataset import HeadDataset
from dfrf.data.ray_batch import RayBatch, draw_rays
from dfrf.field.reference_views import ReferenceViews
from dfrf.method_interface import Method
from dfrf.training.reference_source import random_frames
from dfrf.workers import Workers

SEED = 0


@dataclass(frozen=True)
class HeldOutRays:
    """Rays of some frames of a person, to be rendered with references from other frames."""

    dataset: HeadDataset
    batch: RayBatch
    views: ReferenceViews | None

    def psnr(self, method: Method[Any, Any]) -> float:
        """PSNR in dB over the rays."""
        batch = self.batch.to(method.model.device)
        maps = None if self.views is None else method.maps(self.views)
        colours = method.render_batch(self.dataset, batch, maps)
        # NaN counts as black for white, not as the best of all.
        mse = F.mse_loss(colours, batch.colour).nan_to_num(nan=1.0).item()
        return -10 * math.log10(max(mse, 1e-10))


def draw_held_out_rays(
    dataset: HeadDataset, method: Method[Any, Any], config: TrainConfig
) -> HeldOutRays:
    """Rays as in a step, and references from other frames; the same in every run.

    Args:
        dataset: of the person held out.
        method: of the model that is measured.
        config: how many rays and frames.
    """
    generator = torch.Generator().manual_seed(SEED)
    some = torch.randint(dataset.frames, (config.frames,), generator=generator)
    batch = draw_rays(dataset, some, config, generator)
    if not method.references:
        return HeldOutRays(dataset, batch, None)
    chosen = random_frames(dataset, method.references, batch.frames, generator)
    return HeldOutRays(dataset, batch, method.reference_views(dataset, chosen, mouths=False))


class Validation:
    """Measures a model on people held out, and keeps the best one.

    Args:
        datasets: of the people held out; nothing is measured without.
        since: steps of the first stage: a model that never learned to warp is not the best of all.

    Attributes:
        rows: step and PSNR in dB of each person, 1 + P numbers for each measurement.
        best: weights of the best model by the mean PSNR.
    """

    def __init__(self, datasets: Sequence[HeadDataset] = (), since: int = 0) -> None:
        self.datasets = datasets
        self.since = since
        self.rows: list[tuple[float, ...]] = []
        self.best: dict[str, Tensor] = {}
        self._rays: list[HeldOutRays] = []

    @property
    def names(self) -> list[str]:
        """Names of the people, in their order."""
        return [p.name for p in self.datasets]

    def best_row(self) -> int:
        """Index of the measurement with the highest mean since the warp learns; the first of
        equals.
        """
        means = [sum(row[1:]) if row[0] >= self.since else -math.inf for row in self.rows]
        return means.index(max(means))

    def should_stop(self, patience: int) -> bool:
        """Whether the last `patience` measurements brought no improvement."""
        if not self.rows or self.rows[-1][0] < self.since:
            return False
        return len(self.rows) - 1 - self.best_row() >= patience

    def measure(
        self, method: Method[Any, Any], config: TrainConfig, done: int, workers: Workers
    ) -> None:
        """Measures a model after `done` steps, where that is due; keeps it if it is the best."""
        if not self.datasets or not config.checkpoint_due(done):
            return
        if not self._rays:
            self._rays = [draw_held_out_rays(d, method, config) for d in self.datasets]
        psnrs = workers.map(lambda rays: rays.psnr(method), self._rays)
        self.rows.append((done, *psnrs))
        if self.best_row() == len(self.rows) - 1:
            kept = method.model.state_dict().items()
            self.best = {k: v.detach().cpu().clone() for k, v in kept}
