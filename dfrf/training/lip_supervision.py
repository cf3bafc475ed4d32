"""Teaching the speech networks what the lips do, and showing the field what they did.

A picture tells the speech code little: most of its error is hair and skin, and fifteen seconds of
one person are soon learned by heart. Lip shapes that tracking measured anyway say directly what has
to be heard. So the speech networks learn from those alone, and while pictures are learned each
frame's code is moved to where it says what the lips really did: the field learns what lips look
like, not what was heard wrongly.

T frames with pictures, C frames in a row, B of them in a batch, K lip measures, A numbers of a
code, D speech features.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.data import Identity, neighbour_windows
from dfrf.field.model import Model

BATCH = 128
PEOPLE = 4  # in a batch: with one at a time the networks swing from person to person
LEARNING_RATE = 2e-3
SPOILT = 0.1  # features left out of a window
RIDGE = 1.0  # times the mean power of a feature, for all people together
TEACHER = 0.7  # share of the teacher's answer in what is to be learned
AT_ONCE = 256
OPENING = 0  # of the lip measures: the gap in the middle
SHUT = 0.05  # share of the frames that are taken for shut


@dataclass(frozen=True)
class Lesson:
    """What the networks are to say of each frame of a person, (C, K)."""

    person: Identity
    lips: Tensor


def context(person: Identity) -> Tensor:
    """What a linear map is told of each frame, (C, 10 D + 1).

    Its window in steps of 40 ms, and means of the half windows before and after it.
    """
    parts = []
    for frames in torch.arange(len(person.windows)).split(AT_ONCE):
        near = neighbour_windows(person.windows, person.segment, frames) * 2 - 1
        middle = near.shape[1] // 2
        own = near[:, middle].unflatten(1, (-1, 2)).mean(2).flatten(1)
        half = near.shape[2] // 2
        before, after = near[:, 0, :half].mean(1), near[:, -1, half:].mean(1)
        parts.append(torch.cat([own, before, after, torch.ones(len(frames), 1)], 1))
    return torch.cat(parts)


def lessons(people: Sequence[Identity]) -> list[Lesson]:
    """The lips of each person, mixed with what a ridge regression on all the others says.

    The regression cannot know how this person differs from the others, so nor do its answers: the
    networks carry to a stranger what they learn from it. On people left out, the codes of networks
    taught this way say .60 / .54 of opening and width, .51 / .45 taught by the lips alone.
    """
    if len(people) < 2:
        return [Lesson(p, p.lips) for p in people]
    told = [context(p) for p in people]
    squares = [x.T @ x / len(x) for x in told]
    products = [x.T @ p.lips / len(x) for x, p in zip(told, people, strict=True)]
    made = []
    for k, person in enumerate(people):
        square = torch.stack(squares[:k] + squares[k + 1 :]).sum(0)
        product = torch.stack(products[:k] + products[k + 1 :]).sum(0)
        square.diagonal().add_(RIDGE * square.diagonal().mean())
        said = told[k] @ torch.linalg.solve(square, product)
        made.append(Lesson(person, TEACHER * said + (1 - TEACHER) * person.lips))
    return made


def draw_lesson(
    taught: Sequence[Lesson], count: int, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Windows (B, 8, 16, D) of random frames of a few people, and their lips (B, K)."""
    windows, lips = [], []
    for k in torch.randperm(len(taught), generator=generator)[:PEOPLE].tolist():
        person = taught[k].person
        share = count // min(PEOPLE, len(taught))
        frames = torch.randint(len(person.windows), (share,), generator=generator)
        windows.append(neighbour_windows(person.windows, person.segment, frames))
        lips.append(taught[k].lips[frames])
    return torch.cat(windows), torch.cat(lips)


def learn_lips(
    model: Model, people: Sequence[Identity], iterations: int, generator: torch.Generator
) -> float:
    """Trains the speech networks alone on the lips of all people, and freezes them.

    The measures have mean 0 and variance 1 for each person, so 1 is the error of knowing nothing.

    Returns:
        the last mean loss.
    """
    speech = (model.field.audio, model.field.attention, model.field.lips)
    parameters = [p for part in speech for p in part.parameters()]
    for parameter in parameters:
        parameter.requires_grad_(True)
    optimiser = torch.optim.AdamW(parameters, lr=LEARNING_RATE, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(iterations, 1))
    device = model.grid.low.device
    taught = lessons(people)
    mean = 1.0
    for _ in range(iterations):
        windows, lips = draw_lesson(taught, BATCH, generator)
        kept = torch.rand(len(windows), 1, 1, windows.shape[-1], generator=generator) >= SPOILT
        # A feature left out is 0 to AudioNet, which sees windows centred on 0.5.
        spoilt = torch.where(kept, windows, 0.5)
        said = model.field.lips(model.field.speech_codes(spoilt.to(device)))
        loss = F.mse_loss(said, lips.to(device))
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(parameters, 1.0)
        optimiser.step()
        schedule.step()
        mean = 0.98 * mean + 0.02 * loss.item()
    for parameter in parameters:
        parameter.requires_grad_(False)
    return mean


@torch.no_grad()
def spoken_codes(model: Model, person: Identity) -> Tensor:
    """The code of every frame of a person, (C, A), on the model's device."""
    device = model.grid.low.device
    codes = []
    for frames in torch.arange(len(person.windows)).split(AT_ONCE):
        windows = neighbour_windows(person.windows, person.segment, frames)
        codes.append(model.field.speech_codes(windows.to(device)))
    return torch.cat(codes)


@torch.no_grad()
def shown_codes(model: Model, person: Identity) -> Tensor:
    """Codes (T, A) that say of each picture what the lips did, not what was heard of it.

    Each code is moved by the shortest way to where the lip measures read off it are the measured
    ones, given the mean and the spread that read-off ones have over these frames: so the rendered
    lips move as far on speech as the real ones did.
    """
    codes = spoken_codes(model, person)
    shown = model.field.saying(codes, wanted_lips(model, person, codes))
    return shown[person.number.to(codes.device)]


@torch.no_grad()
def shut_lips(model: Model, person: Identity) -> Tensor:
    """What is read off the codes (K,) where the mouth is shut: in the least open of the frames."""
    wanted = wanted_lips(model, person, spoken_codes(model, person))
    least = person.lips[:, OPENING].argsort()[: max(1, round(SHUT * len(person.lips)))]
    return wanted[least.to(wanted.device)].mean(0)


def wanted_lips(model: Model, person: Identity, codes: Tensor) -> Tensor:
    """The measured lips (C, K) with mean and spread of those read off the codes (C, A)."""
    said = model.field.lips(codes)
    return said.mean(0) + said.std(0) * person.lips.to(codes.device)
