"""A share of a training step: rays of a few frames with similar head poses.

B rays, F frames in a share, T frames of a dataset, K numbers of conditioning.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.data.ray_batch import RayBatch, SurfaceRays, draw_rays, similar_frames, surface_rays

SURFACE_RAYS = 24  # a frame


@dataclass(frozen=True)
class RayShare:
    """A share of a step's rays.

    Attributes:
        batch: the rays.
        conditioning: of the batch's frames.
        jitter: in 0..1.
        surface: rays through the mean face.
        windows: speech windows of the batch's frames, where images train the speech networks.
    """

    batch: RayBatch
    conditioning: Float[Tensor, "F K"]
    jitter: Float[Tensor, " B"]
    surface: SurfaceRays
    windows: Float[Tensor, "F 8 W D"] | None = None


def draw_shares(
    dataset: HeadDataset,
    conditioning: Float[Tensor, "T K"],
    config: TrainConfig,
    generator: torch.Generator,
    count: int,
) -> list[RayShare]:
    """Shares of a step's rays, on the device of the conditioning.

    The rays of a share read the same references, so its frames have similar head poses.
    """
    device = conditioning.device
    part = replace(config, rays=config.rays // count, frames=max(1, config.frames // count))
    shares = []
    for _ in range(count):
        frames = similar_frames(dataset, part.frames, generator)
        batch = draw_rays(dataset, frames, part, generator).to(device)
        jitter = torch.rand(batch.frame.numel(), generator=generator).to(device)
        surface = surface_rays(dataset, batch.frames, SURFACE_RAYS, generator).to(device)
        shares.append(RayShare(batch, conditioning[batch.frames.to(device)], jitter, surface))
    return shares
