"""The speech networks learn from the lips, and the field is conditioned on what these did.

Pictures teach speech codes badly: most of their error is hair and skin, and a network soon knows
fifteen seconds of one person by heart. Lip shapes, which tracking measures anyway, are the direct
target. So the speech networks learn from lips alone. While pictures are learned, the code of a
frame is moved to where the measured lips are read off it: the field learns what lips look like, not
what was heard wrongly.

T frames with pictures, C frames in a row, B of them in a batch, L lip measures, A numbers of a
code, W steps of a speech window and D features of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.data.dataset import HeadDataset, neighbour_windows
from dfrf.field.conditioning import Conditioning
from dfrf.field.speaker_adaptation import closed_mouth

BATCH = 128
PEOPLE = 4  # in a batch: with one at a time the networks swing from person to person
LEARNING_RATE = 2e-3
DROPPED = 0.1  # features left out of a window
RIDGE = 1.0  # times the mean power of a feature, for all people together
REGRESSION_SHARE = 0.7  # of the regression's answer in what is to be learned
AT_ONCE = 256


@dataclass(frozen=True)
class LipTargets:
    """What the networks have to predict for each frame of a person."""

    dataset: HeadDataset
    lips: Float[Tensor, "C L"]


def regression_input(dataset: HeadDataset) -> Float[Tensor, "C I"]:
    """What a linear map reads of each frame, I = 10 D + 1 numbers.

    Its window in steps of 40 ms, and means of the half windows before and after it.
    """
    parts = []
    for frames in torch.arange(len(dataset.windows)).split(AT_ONCE):
        near = neighbour_windows(dataset.windows, dataset.segment, frames) * 2 - 1
        middle = near.shape[1] // 2
        own = near[:, middle].unflatten(1, (-1, 2)).mean(2).flatten(1)
        half = near.shape[2] // 2
        before, after = near[:, 0, :half].mean(1), near[:, -1, half:].mean(1)
        parts.append(torch.cat([own, before, after, torch.ones(len(frames), 1)], 1))
    return torch.cat(parts)


def lip_targets(datasets: Sequence[HeadDataset]) -> list[LipTargets]:
    """The lips of each person, mixed with the prediction of a ridge regression on all others.

    The regression cannot know how this person differs from the others, so nor do its answers: the
    networks carry to a stranger what they learn from it. On people left out, the codes of networks
    taught this way correlate .60 / .54 with opening and width, .51 / .45 taught by lips alone.
    """
    if len(datasets) < 2:
        return [LipTargets(d, d.lips) for d in datasets]
    inputs = [regression_input(d) for d in datasets]
    squares = [x.T @ x / len(x) for x in inputs]
    products = [x.T @ d.lips / len(x) for x, d in zip(inputs, datasets, strict=True)]
    made = []
    for k, dataset in enumerate(datasets):
        square = torch.stack(squares[:k] + squares[k + 1 :]).sum(0)
        product = torch.stack(products[:k] + products[k + 1 :]).sum(0)
        square.diagonal().add_(RIDGE * square.diagonal().mean())
        answer = inputs[k] @ torch.linalg.solve(square, product)
        mixed = REGRESSION_SHARE * answer + (1 - REGRESSION_SHARE) * dataset.lips
        made.append(LipTargets(dataset, mixed))
    return made


def draw_windows(
    targets: Sequence[LipTargets], count: int, generator: torch.Generator
) -> tuple[Float[Tensor, "B 8 W D"], Float[Tensor, "B L"]]:
    """Windows of random frames of a few people and of their neighbours, and their lips."""
    windows, lips = [], []
    for k in torch.randperm(len(targets), generator=generator)[:PEOPLE].tolist():
        dataset = targets[k].dataset
        share = count // min(PEOPLE, len(targets))
        frames = torch.randint(len(dataset.windows), (share,), generator=generator)
        windows.append(neighbour_windows(dataset.windows, dataset.segment, frames))
        lips.append(targets[k].lips[frames])
    return torch.cat(windows), torch.cat(lips)


def train_speech_networks(
    conditioning: Conditioning,
    datasets: Sequence[HeadDataset],
    iterations: int,
    generator: torch.Generator,
) -> float:
    """Trains the speech networks alone on the lips of all people, and freezes them.

    The measures have mean 0 and variance 1 for each person, so 1 is the error of knowing nothing.

    Returns:
        the last mean loss.
    """
    speech = (conditioning.audio, conditioning.attention, conditioning.lips)
    parameters = [p for part in speech for p in part.parameters()]
    for parameter in parameters:
        parameter.requires_grad_(True)
    optimiser = torch.optim.AdamW(parameters, lr=LEARNING_RATE, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(iterations, 1))
    device = conditioning.closed_mouth_target.device
    targets = lip_targets(datasets)
    mean = 1.0
    for _ in range(iterations):
        windows, lips = draw_windows(targets, BATCH, generator)
        kept = torch.rand(len(windows), 1, 1, windows.shape[-1], generator=generator) >= DROPPED
        # A feature left out is 0 to AudioNet, which sees windows centred on 0.5.
        windows = torch.where(kept, windows, 0.5)
        read = conditioning.lips(conditioning.speech_codes(windows.to(device)))
        loss = F.mse_loss(read, lips.to(device))
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
def dataset_codes(conditioning: Conditioning, dataset: HeadDataset) -> Float[Tensor, "C A"]:
    """The code of every frame of a person as it is heard, on the networks' device."""
    device = conditioning.closed_mouth_target.device
    codes = []
    for frames in torch.arange(len(dataset.windows)).split(AT_ONCE):
        windows = neighbour_windows(dataset.windows, dataset.segment, frames)
        codes.append(conditioning.speech_codes(windows.to(device)))
    return torch.cat(codes)


def target_lips(
    conditioning: Conditioning, dataset: HeadDataset, codes: Float[Tensor, "C A"]
) -> Float[Tensor, "C L"]:
    """The measured lips with mean and spread of those read off the codes."""
    mean, spread = lips_read(conditioning, codes)
    return mean + spread * dataset.lips.to(codes.device)


def lips_read(
    conditioning: Conditioning, codes: Float[Tensor, "C A"]
) -> tuple[Float[Tensor, " L"], Float[Tensor, " L"]]:
    """Mean and spread of the lip measures that are read off codes."""
    read = conditioning.lips(codes)
    return read.mean(0), read.std(0)


@torch.no_grad()
def supervised_codes(conditioning: Conditioning, dataset: HeadDataset) -> Float[Tensor, "T A"]:
    """Codes off which the measured lips of each picture are read, not the heard ones.

    Each code is moved by the shortest way to where the lip measures read off it are the measured
    ones, given the mean and the spread that read-off ones have over these frames: so the rendered
    lips move as far on speech as the real ones did.
    """
    codes = dataset_codes(conditioning, dataset)
    lips = target_lips(conditioning, dataset, codes)
    return conditioning.project_to_lips(codes, lips)[dataset.number.to(codes.device)]


@torch.no_grad()
def closed_mouth_target(conditioning: Conditioning, dataset: HeadDataset) -> Float[Tensor, " L"]:
    """What is read off the codes where the mouth is closed: in the least open of the frames."""
    mean, spread = lips_read(conditioning, dataset_codes(conditioning, dataset))
    return mean + spread * closed_mouth(dataset.lips).to(mean)


@torch.no_grad()
def fit_speaker_adaptation(conditioning: Conditioning, dataset: HeadDataset) -> None:
    """Fits the adaptation to a person, its answers as the field is conditioned on lips."""
    mean, spread = lips_read(conditioning, dataset_codes(conditioning, dataset))
    predicted, lips, touching = (
        part.to(mean) for part in (dataset.predicted_lips, dataset.lips, dataset.touching)
    )
    conditioning.speaker_adaptation.fit(predicted, lips, touching, mean, spread)
