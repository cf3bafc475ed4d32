"""How the `fast` field and its ablations learn and render: rays through occupied cells.

B rays, F frames in a batch, T frames.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf import device as devices
from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch, cut_references, draw_rays, frames_alike, surface_rays
from dfrf.field import brow_deformation as brows
from dfrf.field.model import REACH, Model
from dfrf.field.reference_maps import ReferenceMaps, ReferenceViews
from dfrf.rendering.frame_renderer import render_frame
from dfrf.rendering.grid_pruning import carve
from dfrf.rendering.volume_rendering import render_rays
from dfrf.training.lip_supervision import learn_lips, shown_codes, shut_lips, spoken_codes
from dfrf.training.losses import weighted_warp_penalty
from dfrf.training.method import Method, Outcome
from dfrf.training.regularizers import distortion_loss, surface_loss
from dfrf.training.speaker_adaptation import learn_manner
from dfrf.unsharp import crisp
from dfrf.workers import Workers

SHARES = 4  # of a step's rays; on a CPU as many cores work side by side
FRAMES_AT_ONCE = 8
SURFACE_RAYS = 24
UNSURE = 0.05  # a matte further than that from 0 and 1 is not sure
SPEECH = ("field.audio.", "field.attention.", "field.lips.", "field.manner.")


@dataclass(frozen=True)
class FastShare:
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


def draw_shares(
    person: Identity, known: Tensor, config: TrainConfig, generator: torch.Generator, count: int
) -> list[FastShare]:
    """Shares of a step's rays, on the device of `known` (T, told_dim).

    The rays of a share look at the same references, so its frames show the head alike.
    """
    device = known.device
    part = replace(config, rays=config.rays // count, frames=max(1, config.frames // count))
    shares = []
    for _ in range(count):
        frames = frames_alike(person, part.frames, generator)
        batch = draw_rays(person, frames, part, generator).to(device)
        jitter = torch.rand(batch.frame.numel(), generator=generator).to(device)
        surface = surface_rays(person, batch.frames, SURFACE_RAYS, generator)
        told = known[batch.frames.to(device)]
        shares.append(FastShare(batch, told, jitter, tuple(s.to(device) for s in surface)))
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
    share: FastShare,
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


def told_of(model: Model, people: Sequence[Identity]) -> dict[str, Tensor]:
    """What the field is told of every frame of each person, (T, told_dim), by name."""
    device = model.device
    if model.config.field.use_speech:
        codes = {p.name: shown_codes(model, p) for p in people}
    else:
        codes = {p.name: torch.zeros(p.frames, model.config.field.code_dim) for p in people}
    return {p.name: torch.cat([codes[p.name].to(device), p.upper.to(device)], -1) for p in people}


class FastMethod(Method[FastShare, ReferenceMaps]):
    """The field that knows where it is, and learns speech from lip measures (`lips`).

    Attributes:
        known: what the field is told of every frame of each person of a run, (T, told_dim).
    """

    side_by_side = SHARES
    segment = 50
    reach = REACH

    def __init__(self, model: Model) -> None:
        self._model = model
        self.known: dict[str, Tensor] = {}

    @property
    def model(self) -> Model:
        return self._model

    @property
    def references(self) -> int:
        return self.model.config.field.references

    @property
    def shown(self) -> int:
        return self.model.config.field.shown if self.references else 0

    def views(
        self, person: Identity, frames: Tensor, asked: Tensor | None = None
    ) -> ReferenceViews:
        return cut_references(person, frames, asked)

    def encode(self, views: ReferenceViews) -> ReferenceMaps:
        maps: ReferenceMaps = self.model.field.encoder(views)
        return maps

    def stored(self, maps: ReferenceMaps) -> ReferenceMaps:
        return maps.as_type(devices.table_type(maps.table.device))

    def learns(self, name: str, config: TrainConfig) -> bool:
        """Not the speech networks, see `lips`; the reference network where `config` says so."""
        if name.startswith(SPEECH):
            return False
        return config.learn_references_every > 0 or not name.startswith("field.encoder.")

    def begin(
        self,
        people: Sequence[Identity],
        held: Sequence[Identity],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        if not resumed and config.lip_iterations and self.model.config.field.use_speech:
            learn_lips(self.model, people, config.lip_iterations, generator)
        self.known = told_of(self.model, [*people, *held])

    def draw(
        self, person: Identity, config: TrainConfig, generator: torch.Generator
    ) -> list[FastShare]:
        known = self.known[person.name]
        return draw_shares(person, known, config, generator, SHARES)

    def outcome(
        self,
        share: FastShare,
        maps: ReferenceMaps | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> Outcome:
        warp = step >= config.coarse_iterations
        return share_outcome(self.model, share, maps, config, warp, wanted)

    @torch.no_grad()
    def picture(self, person: Identity, batch: RayBatch, maps: ReferenceMaps | None) -> Tensor:
        known = self.known[person.name]
        told = known[batch.frames.to(known.device)]
        seen = render_rays(self.model, batch.origins, batch.directions, batch.frame, told, maps)
        return seen.colour + (1 - seen.opacity[:, None]) * batch.background

    def learned(self, done: Outcome) -> None:
        self.model.grid.observe(done.points, done.weights)

    def stepped(self, step: int, config: TrainConfig) -> None:
        if (step + 1) % config.occupancy_every == 0:
            self.model.grid.refresh()

    def finish(self, person: Identity, views: ReferenceViews | None, seed: int) -> None:
        """Notes what is the person's own and what is usual; closes cells that show nothing."""
        model = self.model
        if model.config.field.use_speech:
            learn_manner(model, person)
            model.field.shut.copy_(shut_lips(model, person))
            model.field.usual.copy_(spoken_codes(model, person).mean(0))
        model.field.brow_range.copy_(brows.usual_range(person.upper[:, brows.MEASURES]))
        maps = None if views is None else self.maps(views)
        told = told_of(model, [person])[person.name]
        generator = torch.Generator().manual_seed(seed)
        carve(model.eval(), told, person.c2w, maps, generator)

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
        """On a CPU as many at once as there are cores."""
        with torch.no_grad():
            told = self.model.eval().field.told(windows, upper)
        model = self.model.rounded()

        def one(t: int) -> tuple[Tensor, Tensor]:
            region = None if regions is None else regions[t].to(c2w.device)
            colour, opacity = render_frame(
                model, c2w[t], focal, centres[t], told[t], maps, size, region
            )
            return crisp(colour, opacity), opacity

        with Workers(c2w.device, FRAMES_AT_ONCE) as workers:
            yield from workers.map(one, range(c2w.shape[0]))
