"""Teaching the speech networks what the lips do, before and beside the pictures.

A picture tells the speech code little: most of its error is hair and skin. Lip shapes that tracking
measured anyway say directly what has to be heard, and all frames can be looked at in no time.

T frames, B of them in a batch, K lip measures.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.data import Identity, neighbour_windows
from dfrf.model import Model

BATCH = 128
LEARNING_RATE = 2e-3


def lip_loss(model: Model, person: Identity, count: int, generator: torch.Generator) -> Tensor:
    """Mean squared error of the lip measures read off the speech codes of `count` random frames.

    The measures have mean 0 and variance 1 for each person, so 1 is the error of knowing nothing.
    """
    device = model.grid.low.device
    frames = torch.randint(person.frames, (count,), generator=generator)
    windows = neighbour_windows(person.windows, person.segment, frames)
    codes = model.field.speech_codes(windows.to(device))
    return F.mse_loss(model.field.lips(codes), person.lips[frames].to(device))


def learn_lips(
    model: Model, people: Sequence[Identity], iterations: int, generator: torch.Generator
) -> float:
    """Trains the speech networks alone on the lips of all people; returns the last mean loss."""
    speech = (model.field.audio, model.field.attention, model.field.lips)
    parameters = [p for part in speech for p in part.parameters()]
    optimiser = torch.optim.AdamW(parameters, lr=LEARNING_RATE, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(iterations, 1))
    mean = 1.0
    for _ in range(iterations):
        person = people[int(torch.randint(len(people), (1,), generator=generator))]
        loss = lip_loss(model, person, BATCH, generator)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()
        schedule.step()
        mean = 0.98 * mean + 0.02 * loss.item()
    return mean
