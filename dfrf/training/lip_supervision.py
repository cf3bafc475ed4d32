"""Lip supervision: the speech networks are trained on lip measures, not on images.

Images train speech codes badly: most of their error is hair and skin, and a network soon overfits
fifteen seconds of one person. Lip measures, which tracking gives anyway, are the direct target. So
the speech networks are trained on lips alone. While the field is trained on images, the code of a
frame is moved so that it decodes to the measured lips: the field then learns how lips look, without
the errors of the speech networks.

T frames with images, C frames in a row, B of them in a batch, L lip measures, A numbers of a
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
DROPPED = 0.1  # share of features that are dropped from a window
RIDGE = 1.0  # times the mean power of a feature, for all people together
REGRESSION_SHARE = 0.7  # of the regression's answer in the target
AT_ONCE = 256
LEAST_SPREAD = 1e-6


@dataclass(frozen=True)
class LipTargets:
    """Targets of the speech networks for each frame of a person."""

    dataset: HeadDataset
    lips: Float[Tensor, "C L"]


def regression_input(dataset: HeadDataset) -> Float[Tensor, "C I"]:
    """Inputs of the linear regression for each frame, I = 10 D + 1 numbers.

    Its window in steps of 40 ms, means of the half windows before and after it, and a 1.
    """
    parts = []
    for frames in torch.arange(len(dataset.windows)).split(AT_ONCE):
        windows = neighbour_windows(dataset.windows, dataset.segment, frames) * 2 - 1
        middle = windows.shape[1] // 2
        own = windows[:, middle].unflatten(1, (-1, 2)).mean(2).flatten(1)
        half = windows.shape[2] // 2
        before, after = windows[:, 0, :half].mean(1), windows[:, -1, half:].mean(1)
        parts.append(torch.cat([own, before, after, torch.ones(len(frames), 1)], 1))
    return torch.cat(parts)


def lip_targets(datasets: Sequence[HeadDataset]) -> list[LipTargets]:
    """The lips of each person, blended with the answer of a ridge regression on all others.

    The regression cannot know how this person differs from the others, so networks trained on its
    answers generalise better. On held-out people, their codes correlate .60 / .54 with opening and
    width; trained on lips alone, .51 / .45.
    """
    if len(datasets) < 2:
        return [LipTargets(d, d.lips) for d in datasets]
    inputs = [regression_input(d) for d in datasets]
    squares = [x.T @ x / len(x) for x in inputs]
    products = [x.T @ d.lips / len(x) for x, d in zip(inputs, datasets, strict=True)]
    targets = []
    for k, dataset in enumerate(datasets):
        square = torch.stack(squares[:k] + squares[k + 1 :]).sum(0)
        product = torch.stack(products[:k] + products[k + 1 :]).sum(0)
        square.diagonal().add_(RIDGE * square.diagonal().mean())
        answer = inputs[k] @ torch.linalg.solve(square, product)
        blended = REGRESSION_SHARE * answer + (1 - REGRESSION_SHARE) * dataset.lips
        targets.append(LipTargets(dataset, blended))
    return targets


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
    """Trains only the speech networks, on the lips of all people, and freezes them.

    The measures have mean 0 and variance 1 for each person, so predicting the mean gives a loss
    of 1.

    Returns:
        The last mean loss.
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
        # A dropped feature is 0 to AudioNet, whose windows are centred on 0.5.
        windows = torch.where(kept, windows, 0.5)
        decoded = conditioning.lips(conditioning.speech_codes(windows.to(device)))
        loss = F.mse_loss(decoded, lips.to(device))
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
    """Speech codes of all frames of a person, on the networks' device."""
    device = conditioning.closed_mouth_target.device
    codes = []
    for frames in torch.arange(len(dataset.windows)).split(AT_ONCE):
        windows = neighbour_windows(dataset.windows, dataset.segment, frames)
        codes.append(conditioning.speech_codes(windows.to(device)))
    return torch.cat(codes)


def target_lips(
    conditioning: Conditioning, dataset: HeadDataset, codes: Float[Tensor, "C A"]
) -> Float[Tensor, "C L"]:
    """The measured lips with the mean and spread of those decoded from the codes."""
    mean, spread = decoded_statistics(conditioning, codes)
    return mean + spread * dataset.lips.to(codes.device)


def decoded_statistics(
    conditioning: Conditioning, codes: Float[Tensor, "C A"]
) -> tuple[Float[Tensor, " L"], Float[Tensor, " L"]]:
    """Mean and spread of the lip measures decoded from codes."""
    decoded = conditioning.lips(codes)
    return decoded.mean(0), decoded.std(0)


@torch.no_grad()
def supervised_codes(conditioning: Conditioning, dataset: HeadDataset) -> Float[Tensor, "T A"]:
    """Codes that decode to the measured lips of each image.

    Each code is replaced by the nearest one that decodes to the measured lips. These are first
    scaled to the mean and spread of the decoded lips, so that on speech rendered lips move as far
    as the real ones did.
    """
    codes = dataset_codes(conditioning, dataset)
    lips = target_lips(conditioning, dataset, codes)
    return conditioning.project_to_lips(codes, lips)[dataset.number.to(codes.device)]


@torch.no_grad()
def scale_decoded_lips(conditioning: Conditioning, dataset: HeadDataset) -> None:
    """Scales the decoder so that lips decoded from a person's speech have mean 0 and variance 1.

    The measured lips have these, too, so measures decoded from codes then are the person's own.
    The code that decodes to some lips stays the same. Codes that are not finite change nothing.
    """
    mean, spread = decoded_statistics(conditioning, dataset_codes(conditioning, dataset))
    if spread.isfinite().all():
        spread = spread.clamp_min(LEAST_SPREAD)
        conditioning.lips.weight.div_(spread[:, None])
        conditioning.lips.bias.sub_(mean).div_(spread)


@torch.no_grad()
def fit_speaker_adaptation(conditioning: Conditioning, dataset: HeadDataset) -> None:
    """Fits the speaker adaptation to a person, and what their closed mouth is."""
    closed = conditioning.closed_mouth_target
    predicted, lips, touching = (
        part.to(closed) for part in (dataset.predicted_lips, dataset.lips, dataset.touching)
    )
    conditioning.speaker_adaptation.fit(predicted, lips, touching)
    closed.copy_(closed_mouth(lips))
