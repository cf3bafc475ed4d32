"""One step of training: its rays are dealt out in shares, and the shares' gradients are added up.

Shares are worked on side by side (`workers`). Their number is fixed, so the gradient does not
depend on how many cores there are. B rays, F frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.compactness import distortion_loss, surface_loss
from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch, draw_rays, surface_rays
from dfrf.losses import weighted_warp_penalty
from dfrf.model import Model, ReferenceMaps
from dfrf.rendering import render_rays
from dfrf.workers import Workers

SURFACE_RAYS = 24
UNSURE = 0.05  # a matte further than that from 0 and 1 is not sure


@dataclass(frozen=True)
class Share:
    """What is drawn for a part of a step's rays.

    Attributes:
        batch: the rays.
        told: (F, told_dim) what the field is told of the batch's frames.
        jitter: (B,) in 0..1.
        surface: origins, directions, frame and distance of rays through the mean face.
    """

    batch: RayBatch
    told: Tensor
    jitter: Tensor
    surface: tuple[Tensor, ...]


@dataclass(frozen=True)
class Outcome:
    """What a step, or a share of one, came to.

    Attributes:
        loss, mse: scalars.
        gradients: of the loss, one for each tensor asked for; None where it takes no part.
        points, weights: (M, 3) and (M,) samples and their rendering weights.
        rays: B.
    """

    loss: Tensor
    mse: Tensor
    gradients: list[Tensor | None]
    points: Tensor
    weights: Tensor
    rays: int


def draw_shares(
    person: Identity, known: Tensor, config: TrainConfig, generator: torch.Generator, count: int
) -> list[Share]:
    """Shares of a step's rays, on the device of `known` (T, told_dim)."""
    device = known.device
    part = replace(config, rays=config.rays // count, frames=max(1, config.frames // count))
    shares = []
    for _ in range(count):
        batch = draw_rays(person, part, generator).to(device)
        jitter = torch.rand(batch.frame.numel(), generator=generator).to(device)
        surface = surface_rays(person, batch.frames, SURFACE_RAYS, generator)
        told = known[batch.frames.to(device)]
        shares.append(Share(batch, told, jitter, tuple(s.to(device) for s in surface)))
    return shares


def matte_loss(opacity: Tensor, matte: Tensor) -> Tensor:
    """Mean squared difference of opacity and matte, (B,) in 0..1, where the matte is sure.

    A soft edge of a matte is a guess. What is behind it is known there, so the picture itself says
    how opaque the head is.
    """
    sure = ((matte - 0.5).abs() > 0.5 - UNSURE).to(matte.dtype)
    return (sure * (opacity - matte) ** 2).mean()


def share_outcome(
    model: Model,
    share: Share,
    maps: ReferenceMaps | None,
    config: TrainConfig,
    warp: bool,
    wanted: Sequence[Tensor],
) -> Outcome:
    """Loss of equation (9), with what keeps the density compact, and its gradients."""
    batch = share.batch
    seen = render_rays(
        model,
        batch.origins,
        batch.directions,
        batch.frame,
        share.told,
        maps,
        jitter=share.jitter,
        warp=warp,
    )
    picture = seen.colour + (1 - seen.opacity[:, None]) * batch.background
    mse = F.mse_loss(picture, batch.colour)
    loss = mse + config.opacity_weight * matte_loss(seen.opacity, batch.matte)
    if warp and seen.offset.numel():
        loss = loss + config.warp_weight * weighted_warp_penalty(seen.offset, seen.alpha)
    loss = loss + config.distortion_weight * distortion_loss(
        seen.weights, seen.distances, model.config.march.step
    )
    if config.depth_weight:
        origins, directions, frame, distance = share.surface
        face = render_rays(model, origins, directions, frame, share.told, maps, warp=warp)
        loss = loss + config.depth_weight * surface_loss(face.depth, face.opacity, distance)
    gradients = torch.autograd.grad(loss, list(wanted), allow_unused=True)
    weights = seen.weights.detach()[seen.samples.ray, seen.samples.slot]
    return Outcome(
        loss.detach(),
        mse.detach(),
        list(gradients),
        seen.samples.points,
        weights,
        batch.frame.numel(),
    )


def total(outcomes: Sequence[Outcome]) -> Outcome:
    """Means of losses and gradients of shares alike in size, in their order."""
    count = len(outcomes)
    gradients: list[Tensor | None] = []
    for parts in zip(*(o.gradients for o in outcomes), strict=True):
        present = [p for p in parts if p is not None]
        gradients.append(torch.stack(present).sum(0) / count if present else None)
    return Outcome(
        torch.stack([o.loss for o in outcomes]).mean(),
        torch.stack([o.mse for o in outcomes]).mean(),
        gradients,
        torch.cat([o.points for o in outcomes]),
        torch.cat([o.weights for o in outcomes]),
        sum(o.rays for o in outcomes),
    )


def step_outcome(
    model: Model,
    shares: Sequence[Share],
    maps: ReferenceMaps | None,
    config: TrainConfig,
    warp: bool,
    parameters: list[Tensor],
    workers: Workers,
) -> Outcome:
    """Outcome of all shares, with gradients for `parameters`.

    Maps that carry a gradient share a graph, through which threads must not go at once: the shares
    stop at the table, and the graph behind it is gone through once.
    """
    table = None if maps is None or not maps.table.requires_grad else maps.table
    wanted = parameters
    if maps is not None and table is not None:
        leaf = table.detach().requires_grad_()
        wanted, maps = [*parameters, leaf], replace(maps, table=leaf)

    def work(share: Share) -> Outcome:
        return share_outcome(model, share, maps, config, warp, wanted)

    together = total(list(workers.map(work, shares)))
    if table is None:
        return together
    *direct, of_table = together.gradients
    behind = torch.autograd.grad(table, list(parameters), of_table, allow_unused=True)
    both: list[Tensor | None] = []
    for mine, theirs in zip(direct, behind, strict=True):
        present = [g for g in (mine, theirs) if g is not None]
        both.append(torch.stack(present).sum(0) if present else None)
    return replace(together, gradients=both)
