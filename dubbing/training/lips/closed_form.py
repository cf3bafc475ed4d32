"""Linear filters of the lip network by ridge regression.

Letters: F frames, R inputs of a filter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from dubbing.sound_to_lips.network import MEASURES, Linear, LipNetwork
from dubbing.training.lips.lessons import Lesson, Take

STRENGTH = 1.0  # of the ridge, times the mean power of an input
HEARINGS = 5  # takes that are learned from
FOLDS = 8


def at_moments(values: Tensor, moments: np.ndarray) -> Tensor:
    """Values (T, ...) between steps, at moments (F,), straight from one to the next."""
    place = torch.from_numpy(moments).float().clamp(0, len(values) - 1)
    low = place.floor().long().clamp(max=max(0, len(values) - 2))
    share = (place - low)[:, None]
    return values[low] * (1 - share) + values[(low + 1).clamp(max=len(values) - 1)] * share


def fit_filters(network: LipNetwork, found: Sequence[Lesson]) -> None:
    """Sets both linear filters from all lessons, each frame counting the same."""
    fit(network.hidden, found, lambda t: network.inputs(t.activations.float(), t.voice.float())[0])
    fit(network.senones, found, lambda t: network.inputs(t.activations.float(), t.voice.float())[1])


@torch.no_grad()
def said_by_others(network: LipNetwork, found: Sequence[Lesson]) -> list[Tensor]:
    """What filters learned from the other lessons say of each, (F, 7) of mean 0 and variance 1.

    Lessons that stand side by side may show the same person, so they are left out together. Leaves
    the filters of the network as the last ones were.
    """
    said = []
    for part in np.array_split(np.arange(len(found)), min(FOLDS, len(found))):
        fit_filters(network, [one for k, one in enumerate(found) if k not in part])
        for k in part:
            take = found[k].takes[0]
            answers = network.parts(take.activations.float()[None], take.voice.float()[None])[:2]
            both = [
                standard(at_moments(a[0], take.moments(found[k].times))[:, :MEASURES])
                for a in answers
            ]
            said.append(standard(both[0] + both[1]))
    return said


def standard(values: Tensor) -> Tensor:
    """Columns of (F, K) with mean 0 and variance 1."""
    return (values - values.mean(0)) / values.std(0).clamp_min(1e-6)


def fit(linear: Linear, found: Sequence[Lesson], inputs: Callable[[Take], Tensor]) -> None:
    """The filter that gives measures and touching lips, less each clip's own means."""
    square: Tensor | None = None
    product: Tensor | None = None
    for one in found:
        wanted = one.targets()[:, : MEASURES + 1]
        wanted = wanted - wanted.mean(0)
        takes = one.takes[:HEARINGS]
        for take in takes:
            x = at_moments(linear.around(inputs(take)[None])[0], take.moments(one.times))
            x = x - x.mean(0)
            xx, xy = x.T @ x / len(takes), x.T @ wanted / len(takes)
            square = xx if square is None else square + xx
            product = xy if product is None else product + xy
    if square is None or product is None:
        raise ValueError("there is no lesson to learn from")
    square = square.double()
    square.diagonal().add_(STRENGTH * square.diagonal().mean())
    weight = torch.linalg.solve(square, product.double())
    with torch.no_grad():
        linear.map.weight.copy_(weight.T)
        linear.map.bias.zero_()
