"""How the `paper` preset learns and renders: every ray of a picture, all parts end to end.

The published code counts in metres; everything else here counts in head units of 10 cm. The change
of units happens in this file alone.

B rays of one frame, N references, T frames, S the picture's side in pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from dfrf.cameras import pixel_grid, pixel_rays
from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch, draw_rays, neighbour_windows
from dfrf.field.reference_maps import ReferenceViews
from dfrf.published.conditioned_field import ReferenceMaps, References
from dfrf.published.model import PaperModel, paper_loss
from dfrf.training.losses import PAPER_SIZE, mse
from dfrf.training.method import Method, Outcome

METRES = 0.1  # in a head unit
# Where rays are sampled, metres before and behind the middle of the head.
BEFORE, BEHIND = 0.2, 0.4
NEAREST = 0.01
REFERENCES = 4
RAYS_AT_ONCE = 256  # of a rendered frame: their samples take about a third of a gigabyte
UNSMOOTHED = 3  # speech codes stand alone in the first of so many parts of the coarse stage


def in_metres(c2w: Tensor) -> Tensor:
    """Cameras (..., 3, 4) of the published model's world."""
    return torch.cat([c2w[..., :3], METRES * c2w[..., 3:]], -1)


def bounds(c2w: Tensor) -> tuple[float, float]:
    """Depths between which a camera (3, 4), head units, sees a head, metres.

    The published code takes one pair for a whole clip, from the mean of its depths: a head that
    leans towards the camera is cut off there. Here the pair goes with the head.
    """
    depth = METRES * float((c2w[:, 3] * c2w[:, 2]).sum())
    return max(depth - BEFORE, NEAREST), depth + BEHIND


def along_axis(directions: Tensor, c2w: Tensor) -> Tensor:
    """Directions (B, 3) made so long that their component along a camera's axis is 1."""
    return directions / -(directions * c2w[:, 2].to(directions)).sum(-1, keepdim=True)


@dataclass(frozen=True)
class PaperShare:
    """What is drawn for a part of a step's rays: those of one frame.

    Attributes:
        batch: the rays, head units.
        directions: (B, 3), their component along the viewing axis 1.
        bounds: near and far, metres.
        windows: (8, 16, D) speech of the frame and its neighbours.
        seed: of all that is random in the share.
        size: S.
    """

    batch: RayBatch
    directions: Tensor
    bounds: tuple[float, float]
    windows: Tensor
    seed: int
    size: int


class PaperMethod(Method[PaperShare, ReferenceMaps]):
    """The published model: pictures teach all of it, AudioNet and the reference network too.

    Shares are worked on one after the other, each operation on all cores: the samples of one share
    and one gradient of the references' features are all that is in memory beside the model.
    """

    side_by_side = 1
    segment = 1
    reach = 0

    def __init__(self, model: PaperModel) -> None:
        self._model = model

    @property
    def model(self) -> PaperModel:
        return self._model

    @property
    def references(self) -> int:
        return REFERENCES if self.model.config.use_references else 0

    def views(
        self, person: Identity, frames: Tensor, asked: Tensor | None = None
    ) -> ReferenceViews:
        """Whole pictures: the published aggregation is told the pixel that it reads."""
        return ReferenceViews(
            images=person.images[frames],
            mattes=person.mattes[frames],
            c2w=person.c2w[frames],
            focal=person.focal,
            centres=person.centres[frames],
            upper=person.upper[frames],
            eyes=person.eyes,
            scale=person.size / PAPER_SIZE,
        )

    def encode(self, views: ReferenceViews) -> ReferenceMaps:
        images = views.images.float() / 255
        references = References(images, in_metres(views.c2w), views.focal, views.centres)
        return self.model.encode(references)

    def stored(self, maps: ReferenceMaps) -> ReferenceMaps:
        return maps

    def learns(self, name: str, config: TrainConfig) -> bool:
        """All of them: a person's AudioNet and reference network go on learning, as published."""
        return True

    def begin(
        self,
        people: Sequence[Identity],
        held: Sequence[Identity],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        """Nothing: lip measures are no part of the published model."""

    def draw(
        self, person: Identity, config: TrainConfig, generator: torch.Generator
    ) -> list[PaperShare]:
        """As many shares as the step has frames."""
        part = replace(config, rays=config.rays // config.frames, frames=1)
        return [self._share(person, part, generator) for _ in range(config.frames)]

    def _share(
        self, person: Identity, config: TrainConfig, generator: torch.Generator
    ) -> PaperShare:
        frames = torch.randint(person.frames, (1,), generator=generator)
        batch = draw_rays(person, frames, config, generator).to(self.model.device)
        frame = int(frames)
        return PaperShare(
            batch=batch,
            directions=along_axis(batch.directions, person.c2w[frame]),
            bounds=bounds(person.c2w[frame]),
            windows=self._heard(person, frame),
            seed=int(torch.randint(2**62, (1,), generator=generator)),
            size=person.size,
        )

    def _heard(self, person: Identity, frame: int) -> Tensor:
        """Speech windows (8, 16, D) of a frame with a picture and of its neighbours."""
        number = person.number[frame : frame + 1]
        (windows,) = neighbour_windows(person.windows, person.segment, number)
        return windows.to(self.model.device)

    @torch.no_grad()
    def picture(self, person: Identity, batch: RayBatch, maps: ReferenceMaps | None) -> Tensor:
        training = self.model.training
        self.model.eval()
        colours = torch.zeros_like(batch.colour)
        for k, frame in enumerate(batch.frames.tolist()):
            c2w, windows = person.c2w[frame], self._heard(person, frame)
            for rays in torch.nonzero(batch.frame == k).view(-1).split(RAYS_AT_ONCE):
                directions = along_axis(batch.directions[rays], c2w)
                origins, behind = METRES * batch.origins[rays], batch.background[rays]
                seen = self.model(origins, directions, *bounds(c2w), windows, maps, behind)
                colours[rays] = seen["colour"]
        self.model.train(training)
        return colours

    def outcome(
        self,
        share: PaperShare,
        maps: ReferenceMaps | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> Outcome:
        """Both passes; without the warp in the coarse stage, and unsmoothed in its beginning.

        Published training leaves the attention over neighbouring frames out for its first 100,000
        steps, of 300,000 that the paper gives the coarse stage.
        """
        batch, device = share.batch, self.model.device
        seen = self.model(
            METRES * batch.origins,
            share.directions,
            *share.bounds,
            share.windows,
            maps,
            batch.background,
            jitter=True,
            smooth=UNSMOOTHED * step >= config.coarse_iterations,
            warp=step >= config.coarse_iterations,
            generator=torch.Generator(device).manual_seed(share.seed),
        )
        loss = paper_loss(seen, batch.colour, share.size, config.warp_weight)
        gradients = torch.autograd.grad(loss, list(wanted), allow_unused=True)
        along = seen["depths"].detach()[..., None] / METRES
        points = batch.origins[:, None] + along * share.directions[:, None]
        return Outcome(
            loss.detach(),
            mse(seen["colour"].detach(), batch.colour),
            list(gradients),
            points.view(-1, 3),
            seen["weights"].detach().view(-1),
            len(batch.frame),
        )

    def learned(self, done: Outcome) -> None:
        """Nothing: every ray is sampled all along."""

    def stepped(self, step: int, config: TrainConfig) -> None:
        """Nothing."""

    def finish(self, person: Identity, views: ReferenceViews | None, seed: int) -> None:
        """Nothing."""

    def frames(
        self,
        c2w: Tensor,
        focal: float,
        centres: Tensor,
        windows: Tensor,
        upper: Tensor,
        maps: ReferenceMaps | None,
        size: int,
        regions: Tensor | None = None,
    ) -> Iterator[tuple[Tensor, Tensor]]:
        """All of every head. The published model knows nothing of upper faces or of regions."""
        self.model.eval()
        for camera, centre, heard in zip(c2w, centres, windows, strict=True):
            yield self.frame(camera, focal, centre, heard, maps, size)

    @torch.no_grad()
    def frame(
        self,
        c2w: Tensor,
        focal: float,
        centre: Tensor,
        windows: Tensor,
        maps: ReferenceMaps | None,
        size: int,
    ) -> tuple[Tensor, Tensor]:
        """The head of one frame; as `frames`, a few rays after the other."""
        camera, between = in_metres(c2w), bounds(c2w)
        colour, opacity = [], []
        for pixels in pixel_grid(size, size, c2w.device).view(-1, 2).split(RAYS_AT_ONCE):
            origins, directions = pixel_rays(camera, focal, centre, pixels)
            behind = torch.zeros_like(origins)
            seen = self.model(origins, directions, *between, windows, maps, behind)
            colour.append(seen["head"])
            opacity.append(seen["opacity"])
        return torch.cat(colour).view(size, size, 3), torch.cat(opacity).view(size, size)
