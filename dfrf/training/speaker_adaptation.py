"""How one person's lips do what is said: a linear map learned from the seconds of that person.

The speech networks know what lips do on average over people. How wide this person's get, how long
they stay open and how early they close, a few seconds of them tell. C frames in a row, L lip
measures, R = 2 REACH + 1 frames that count.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf.data import HeadDataset
from dfrf.field.conditioning import OWN, REACH, Conditioning, rows_of_neighbours
from dfrf.training.lip_supervision import dataset_codes

# Frames that "as it is said" counts for. On 13 people whom networks taught for this had not heard,
# learning 60 % of each clip (3 to 36 s), what the codes say of the rest has a correlation of .36
# with the lips without this map and .45 with it, better for 11 of them.
PRIOR = 400


def padded_neighbours(lips: Float[Tensor, "C L"]) -> Float[Tensor, "C RL"]:
    """Measures of each frame and of its neighbours, the ends going on."""
    ends = lips[:1].expand(REACH, -1), lips[-1:].expand(REACH, -1)
    return rows_of_neighbours(torch.cat([ends[0], lips, ends[1]]))


@torch.no_grad()
def fit_speaker_adaptation(conditioning: Conditioning, dataset: HeadDataset) -> None:
    """Sets `speaker_adaptation` to what gives the person's measured lips from what codes say.

    A ridge regression on what is left when each measure, in units of its spread, is taken as said.
    Its answers get the mean and the spread of what is said, as the codes that pictures were learned
    with (`lip_supervision.target_lips`).
    """
    said = conditioning.lips(dataset_codes(conditioning, dataset)).double()
    mean, spread = said.mean(0), said.std(0).clamp_min(1e-6)
    unit = (said - mean) / spread
    near = padded_neighbours(unit)
    wanted = dataset.lips.to(near)
    square = near.T @ near
    square.diagonal().add_(PRIOR)
    total = torch.linalg.solve(square, near.T @ (wanted - unit))
    total[OWN] += torch.eye(said.shape[1]).to(total)
    answer = near @ total
    scale = spread / answer.std(0).clamp_min(1e-6)
    weight = (total / spread.repeat(2 * REACH + 1)[:, None] * scale).T
    bias = mean - answer.mean(0) * scale - weight @ mean.repeat(2 * REACH + 1)
    conditioning.speaker_adaptation.weight.copy_(weight)
    conditioning.speaker_adaptation.bias.copy_(bias)
