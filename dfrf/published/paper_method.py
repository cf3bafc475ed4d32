"""The method of the `paper` preset: every ray of an image, all parts trained end to end.

The published code counts in metres; everything else here counts in head units of 10 cm. The change
of units happens in this file alone.

B rays of one frame, N references, T frames, S the image's side in pixels.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.cameras import Camera, pixel_grid, pixel_rays
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset, neighbour_windows
from dfrf.data.ray_batch import RayBatch, draw_rays
from dfrf.field.reference_views import ReferenceViews
from dfrf.method_interface import FrameInputs, Method, StepOutcome
from dfrf.published.conditioned_field import EncodedReferences, References
from dfrf.published.paper_loss import paper_loss
from dfrf.published.paper_model import PaperModel
from dfrf.training.warp_penalty import PAPER_SIZE
from dfrf.workers import Workers

METRES = 0.1  # in a head unit
# Where rays are sampled, metres before and behind the middle of the head.
BEFORE, BEHIND = 0.2, 0.4
NEAREST = 0.01
REFERENCES = 4
RAYS_AT_ONCE = 16  # of a rendered frame: the activations of their samples fit a core's cache
PARTS_AT_ONCE = 8
UNSMOOTHED = 3  # codes are not smoothed in the first of so many parts of the coarse stage


def in_metres(c2w: Tensor) -> Tensor:
    """Cameras (..., 3, 4) of the published model's world."""
    return torch.cat([c2w[..., :3], METRES * c2w[..., 3:]], -1)


def bounds(c2w: Tensor) -> tuple[float, float]:
    """Near and far depth of the head from a camera (3, 4), head units, in metres.

    The published code takes one pair for a whole clip, from the mean of its depths: a head that
    leans towards the camera is cut off there. Here the pair follows the head.
    """
    depth = METRES * float((c2w[:, 3] * c2w[:, 2]).sum())
    return max(depth - BEFORE, NEAREST), depth + BEHIND


def along_axis(directions: Tensor, c2w: Tensor) -> Tensor:
    """Directions (B, 3) scaled so that their component along a camera's axis is 1."""
    return directions / -(directions * c2w[:, 2].to(directions)).sum(-1, keepdim=True)


@dataclass(frozen=True)
class PaperShare:
    """A share of a step's rays: those of one frame.

    Attributes:
        batch: the rays, head units.
        directions: (B, 3), their component along the viewing axis is 1.
        bounds: near and far, metres.
        windows: (8, 16, D) speech of the frame and its neighbours.
        seed: of all random numbers of the share.
        size: S.
    """

    batch: RayBatch
    directions: Tensor
    bounds: tuple[float, float]
    windows: Tensor
    seed: int
    size: int


class PaperMethod(Method[PaperShare, EncodedReferences]):
    """The published model: all of it is trained on images, AudioNet and the reference CNN too.

    Shares are computed one after the other, each operation on all cores: beside the model, memory
    holds the samples of one share and one gradient of the references' features.
    """

    model: PaperModel
    parallel_shares = 1
    segment = 1
    reach = 0

    def __init__(self, model: PaperModel) -> None:
        self.model = model

    @property
    def references(self) -> int:
        return REFERENCES if self.model.config.use_references else 0

    @property
    def speech_dim(self) -> int:
        return self.model.config.speech_dim

    def reference_views(
        self, dataset: HeadDataset, frames: Tensor, mouths: bool = True
    ) -> ReferenceViews:
        """Whole images: the published aggregation takes the position of the pixel as an input."""
        return ReferenceViews(
            images=dataset.images[frames],
            mattes=dataset.mattes[frames],
            c2w=dataset.c2w[frames],
            focal=dataset.focal,
            centres=dataset.centres[frames],
            scale=dataset.size / PAPER_SIZE,
        )

    def encode(self, views: ReferenceViews) -> EncodedReferences:
        images = views.images.float() / 255
        references = References(images, in_metres(views.c2w), views.focal, views.centres)
        return self.model.encode(references)

    def draw_shares(
        self, dataset: HeadDataset, config: TrainConfig, generator: torch.Generator
    ) -> list[PaperShare]:
        """As many shares as the step has frames."""
        part = replace(config, rays=config.rays // config.frames, frames=1)
        return [self._share(dataset, part, generator) for _ in range(config.frames)]

    def _share(
        self, dataset: HeadDataset, config: TrainConfig, generator: torch.Generator
    ) -> PaperShare:
        frames = torch.randint(dataset.frames, (1,), generator=generator)
        batch = draw_rays(dataset, frames, config, generator).to(self.model.device)
        frame = int(frames)
        return PaperShare(
            batch=batch,
            directions=along_axis(batch.directions, dataset.c2w[frame]),
            bounds=bounds(dataset.c2w[frame]),
            windows=self._windows(dataset, frame),
            seed=int(torch.randint(2**62, (1,), generator=generator)),
            size=dataset.size,
        )

    def _windows(self, dataset: HeadDataset, frame: int) -> Tensor:
        """Speech windows (8, 16, D) of a frame with an image and of its neighbours."""
        number = dataset.number[frame : frame + 1]
        (windows,) = neighbour_windows(dataset.windows, dataset.segment, number)
        return windows.to(self.model.device)

    @torch.no_grad()
    def render_batch(
        self, dataset: HeadDataset, batch: RayBatch, maps: EncodedReferences | None
    ) -> Tensor:
        training = self.model.training
        self.model.eval()
        colours = torch.zeros_like(batch.colour)
        for k, frame in enumerate(batch.frames.tolist()):
            c2w, windows = dataset.c2w[frame], self._windows(dataset, frame)
            for rays in torch.nonzero(batch.frame == k).view(-1).split(RAYS_AT_ONCE):
                directions = along_axis(batch.directions[rays], c2w)
                origins, behind = METRES * batch.origins[rays], batch.background[rays]
                rendered = self.model(origins, directions, *bounds(c2w), windows, maps, behind)
                colours[rays] = rendered["colour"]
        self.model.train(training)
        return colours

    def share_outcome(
        self,
        share: PaperShare,
        maps: EncodedReferences | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> StepOutcome:
        """Both passes; without the warp in the coarse stage, and unsmoothed at its beginning.

        Published training leaves the attention over neighbouring frames out for its first 100,000
        steps, of 300,000 that the paper gives the coarse stage.
        """
        batch, device = share.batch, self.model.device
        rendered = self.model(
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
        loss = paper_loss(rendered, batch.colour, share.size, config.warp_weight)
        gradients = torch.autograd.grad(loss, list(wanted), allow_unused=True)
        along = rendered["depths"].detach()[..., None] / METRES
        points = batch.origins[:, None] + along * share.directions[:, None]
        return StepOutcome(
            loss.detach(),
            F.mse_loss(rendered["colour"].detach(), batch.colour),
            list(gradients),
            points.view(-1, 3),
            rendered["weights"].detach().view(-1),
            len(batch.frame),
        )

    def render_frames(
        self, inputs: FrameInputs, maps: EncodedReferences | None
    ) -> Iterator[tuple[Tensor, Tensor]]:
        """Renders the pixels that are needed; the published model uses no lips or expressions."""
        if inputs.lips is not None or (
            inputs.strength is not None and (inputs.strength != 1).any()
        ):
            raise ValueError("the published model has no lip measures: its strength is 1")
        self.model.eval()
        for t, windows in enumerate(inputs.windows):
            camera = Camera(inputs.c2w[t], inputs.focal, inputs.centres[t], inputs.size)
            region = None if inputs.regions is None else inputs.regions[t]
            yield self.render_frame(camera, windows, maps, region)

    def render_frame(
        self,
        camera: Camera,
        windows: Tensor,
        maps: EncodedReferences | None,
        region: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """The head of one frame, some rays on each core at a time; blank outside a region."""
        c2w, between, size = in_metres(camera.c2w), bounds(camera.c2w), camera.size
        head = torch.zeros(size, size, 4, device=c2w.device)
        needed = torch.ones_like(head[..., 0]) if region is None else region
        pixels = pixel_grid(size, size, c2w.device)

        @torch.no_grad()
        def render_pixels(at: Tensor) -> Tensor:
            row, column = at.T
            rays = pixel_rays(c2w, camera.focal, camera.centre, pixels[row, column])
            behind = torch.zeros_like(rays[0])
            rendered = self.model(*rays, *between, windows, maps, behind)
            return torch.cat([rendered["head"], rendered["opacity"][:, None]], 1)

        parts = needed.nonzero().split(RAYS_AT_ONCE)
        with Workers(c2w.device, PARTS_AT_ONCE) as workers:
            for at, colours in zip(parts, workers.map(render_pixels, parts), strict=True):
                head[at[:, 0], at[:, 1]] = colours
        return head[..., :3], head[..., 3]
