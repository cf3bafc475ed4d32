"""How one person's lips do what is said: a linear map learned from the seconds of that person.

The speech networks know what lips do on average over people. How wide this person's get, how long
they stay open and how early they close, a few seconds of them tell. C frames in a row, K lip
measures, R = REACH frames to each side.
"""

from __future__ import annotations

import torch
from torch import Tensor

from dfrf.data import Identity
from dfrf.field.model import OWN, REACH, Model, rows_of_neighbours
from dfrf.training.lip_supervision import spoken_codes

# Frames that "as it is said" counts for. On 13 people whom networks taught for this had not heard,
# learning 60 % of each clip (3 to 36 s), what the codes say of the rest has a correlation of .36
# with the lips without a manner and .45 with it, better for 11 of them.
PRIOR = 400


def beside(said: Tensor) -> Tensor:
    """Measures (C, K) of each frame and of its neighbours, the ends going on: (C, (2R+1) K)."""
    ends = said[:1].expand(REACH, -1), said[-1:].expand(REACH, -1)
    return rows_of_neighbours(torch.cat([ends[0], said, ends[1]]))


@torch.no_grad()
def learn_manner(model: Model, person: Identity) -> None:
    """Sets `field.manner` to what gives the person's measured lips from what the codes say.

    A ridge regression on what is left when each measure, in units of its spread, is taken as said.
    Its answers get the mean and the spread of what is said, as the codes that pictures were learned
    with (`lips.wanted_lips`).
    """
    said = model.field.lips(spoken_codes(model, person)).double()
    mean, spread = said.mean(0), said.std(0).clamp_min(1e-6)
    unit = (said - mean) / spread
    near = beside(unit)
    wanted = person.lips.to(near)
    square = near.T @ near
    square.diagonal().add_(PRIOR)
    total = torch.linalg.solve(square, near.T @ (wanted - unit))
    total[OWN] += torch.eye(said.shape[1]).to(total)
    answer = near @ total
    scale = spread / answer.std(0).clamp_min(1e-6)
    weight = (total / spread.repeat(2 * REACH + 1)[:, None] * scale).T
    bias = mean - answer.mean(0) * scale - weight @ mean.repeat(2 * REACH + 1)
    model.field.manner.weight.copy_(weight)
    model.field.manner.bias.copy_(bias)
