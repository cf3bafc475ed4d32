"""One step of training: its rays are split into shares, whose gradients are summed.

Shares are computed in parallel (`workers`). Their number is fixed, so the gradient does not depend
on the number of cores.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import torch
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.method_interface import Maps, Method, Share, StepOutcome
from dfrf.workers import Workers

ShareT = TypeVar("ShareT", bound=Share)
MapsT = TypeVar("MapsT", bound=Maps)


def total(outcomes: Iterable[StepOutcome]) -> StepOutcome:
    """Means of losses and gradients of shares of equal size, summed in their order.

    A gradient of the references' features is large: only the sum is kept while the next share is
    computed.
    """
    sums: list[Tensor | None] = []
    small: list[StepOutcome] = []
    for outcome in outcomes:
        pairs = zip(sums or [None] * len(outcome.gradients), outcome.gradients, strict=True)
        sums = [_sum(*pair) for pair in pairs]
        small.append(replace(outcome, gradients=[]))
        del outcome, pairs
    return StepOutcome(
        torch.stack([o.loss for o in small]).mean(),
        torch.stack([o.mse for o in small]).mean(),
        [None if s is None else s / len(small) for s in sums],
        torch.cat([o.points for o in small]),
        torch.cat([o.weights for o in small]),
        sum(o.rays for o in small),
    )


def _sum(one: Tensor | None, other: Tensor | None) -> Tensor | None:
    if one is None or other is None:
        return other if one is None else one
    return one + other


def step_outcome(
    method: Method[ShareT, MapsT],
    shares: Sequence[ShareT],
    maps: MapsT | None,
    config: TrainConfig,
    step: int,
    parameters: list[Tensor],
    workers: Workers,
) -> StepOutcome:
    """Outcome of all shares, with gradients for `parameters`.

    Maps that carry a gradient have a graph that threads must not traverse at the same time. So the
    shares stop at the features, and the graph behind them is traversed once.
    """
    features = None if maps is None or not maps.features.requires_grad else maps.features
    wanted = parameters
    if maps is not None and features is not None:
        leaf = features.detach().requires_grad_()
        wanted, maps = [*parameters, leaf], replace(maps, features=leaf)

    def work(share: ShareT) -> StepOutcome:
        return method.share_outcome(share, maps, config, step, wanted)

    together = total(workers.map(work, shares))
    if features is None:
        return together
    *direct, of_features = together.gradients
    behind = torch.autograd.grad(features, list(parameters), of_features, allow_unused=True)
    both = [_sum(mine, theirs) for mine, theirs in zip(direct, behind, strict=True)]
    return replace(together, gradients=both)
