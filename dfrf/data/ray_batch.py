"""Rays drawn from a person's frames. T frames with images, B rays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.cameras import Rays, pixel_rays
from dfrf.config import TrainConfig
from dfrf.data.dataset import EYES, HEAD, MOUTH, OUTSIDE, RIM, HeadDataset
from dfrf.device import Movable

SIMILAR_SHARE = 0.25  # share of a person's frames that count as similar in pose to one of them


@dataclass(frozen=True)
class RayBatch(Movable):
    """Rays of a few frames of one person.

    Attributes:
        origins, directions: head frame, directions of unit length.
        frame: index into `frames`.
        frames: frame numbers of the dataset.
        colour, background, matte: in 0..1.
    """

    origins: Float[Tensor, "B 3"]
    directions: Float[Tensor, "B 3"]
    frame: Int[Tensor, " B"]
    frames: Int[Tensor, " F"]
    colour: Float[Tensor, "B 3"]
    background: Float[Tensor, "B 3"]
    matte: Float[Tensor, " B"]

    @property
    def rays(self) -> Rays:
        """The rays alone."""
        return Rays(self.origins, self.directions, self.frame)

    def to(self, device: torch.device) -> Self:
        """The same rays on a device; `frames` stays where the dataset is."""
        return replace(super().to(device), frames=self.frames)


def similar_frames(
    dataset: HeadDataset, count: int, generator: torch.Generator
) -> Int[Tensor, " F"]:
    """A random frame of a person, and others from the `SIMILAR_SHARE` nearest to it in pose."""
    viewpoint = F.normalize(dataset.c2w[:, :, 3], dim=-1)
    one = torch.randint(dataset.frames, (1,), generator=generator)
    distance = (viewpoint - viewpoint[one]).norm(dim=-1)
    alike = distance.argsort()[: max(count, round(SIMILAR_SHARE * dataset.frames))]
    others = torch.randint(len(alike), (count - 1,), generator=generator)
    return torch.cat([one, alike[others]])


def draw_rays(
    dataset: HeadDataset, frames: Int[Tensor, " F"], config: TrainConfig, generator: torch.Generator
) -> RayBatch:
    """Rays of frames by importance: mouth, eyes, rim, the rest of the head, outside.

    A region whose share is 0 is a part of the head.
    """
    per_frame = config.rays // len(frames)
    beside = config.rim_share + config.outside_share
    shares = (
        (MOUTH, config.mouth_share),
        (EYES, config.eyes_share),
        (RIM, config.rim_share),
        (HEAD, 1 - config.mouth_share - config.eyes_share - beside),
        (OUTSIDE, config.outside_share),
    )
    whole = [code for code, share in shares[:3] if not share]
    pixels, owner = [], []
    for i, t in enumerate(frames.tolist()):
        # numpy finds the pixels of a region five times as fast as torch does.
        region = dataset.regions[t].view(-1).numpy()
        if whole:
            region = np.where(np.isin(region, whole), HEAD, region)
        drawn = []
        for code, share in shares:
            if not share:
                continue
            where = np.flatnonzero(region == code)
            if where.size:
                pick = torch.randint(where.size, (round(per_frame * share),), generator=generator)
                drawn.append(torch.from_numpy(where[pick.numpy()]))
        if not drawn:
            continue
        chosen = torch.cat(drawn)
        pixels.append(chosen)
        owner.append(torch.full_like(chosen, i))
    if not pixels:
        raise ValueError(f"{dataset.name}: the drawn frames show no head")
    pixel, frame = torch.cat(pixels), torch.cat(owner)
    rows, columns = pixel // dataset.size, pixel % dataset.size
    number = frames[frame]
    origins, directions = pixel_rays(
        dataset.c2w[number],
        dataset.focal,
        dataset.centres[number],
        torch.stack([columns, rows], -1).float(),
    )
    directions = F.normalize(directions, dim=-1)

    def at(images: Tensor) -> Tensor:
        return images[number, rows, columns].float() / 255

    return RayBatch(
        origins=origins,
        directions=directions,
        frame=frame,
        frames=frames,
        colour=at(dataset.images),
        background=at(dataset.backgrounds),
        matte=at(dataset.mattes),
    )


@dataclass(frozen=True)
class SurfaceRays(Movable):
    """Rays through points of the mean face.

    Attributes:
        rays: their frame is an index into the given frames.
        distance: of the point along its ray, head units.
    """

    rays: Rays
    distance: Float[Tensor, " B"]


def surface_rays(
    dataset: HeadDataset, frames: Int[Tensor, " F"], per_frame: int, generator: torch.Generator
) -> SurfaceRays:
    """Rays through random points of the mean face, `per_frame` for each frame of a dataset."""
    count = (frames.numel(), per_frame)
    pick = torch.randint(dataset.surface.shape[0], count, generator=generator)
    points = dataset.surface[pick].view(-1, 3)
    frame = torch.arange(frames.numel()).repeat_interleave(per_frame)
    origins = dataset.c2w[frames][frame][:, :, 3]
    gap = points - origins
    distance = gap.norm(dim=-1)
    return SurfaceRays(Rays(origins, gap / distance[:, None], frame), distance)
