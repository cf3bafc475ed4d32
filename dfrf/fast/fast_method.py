"""The method of the `fast` model and its ablations: rays through occupied cells.

T frames, F of them in a batch, S the image's side in pixels, K numbers of conditioning, W steps of
a speech window and D features of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf import device as devices
from dfrf.cameras import Camera
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset, neighbour_windows
from dfrf.data.ray_batch import RayBatch
from dfrf.data.reference_cuts import cut_mouths, cut_references
from dfrf.fast.baking import bake, prune
from dfrf.fast.fast_loss import share_outcome
from dfrf.fast.fast_model import FastModel
from dfrf.fast.medoids import medoids
from dfrf.field.audio import NEIGHBOURS, WINDOW
from dfrf.field.mouth_pixels import MOUTHS, TURN, lip_traits, read_measures
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.reference_views import MouthViews, ReferenceViews
from dfrf.field.speaker_adaptation import CONTEXT_FRAMES, NUMBERS
from dfrf.method_interface import FrameInputs, Method, StepOutcome
from dfrf.rendering.baked_frame import BakedHead
from dfrf.rendering.frame_buffer import HeadImage
from dfrf.rendering.frame_head import FrameHead, MarchedHead
from dfrf.rendering.view_images import ViewImages
from dfrf.rendering.volume_rendering import render_rays
from dfrf.training.lip_supervision import (
    dataset_codes,
    fit_speaker_adaptation,
    scale_decoded_lips,
    supervised_codes,
    target_lips,
    train_speech_networks,
)
from dfrf.training.ray_share import RayShare, draw_shares
from dfrf.workers import Workers

SHARES = 4  # of a step's rays; on a CPU as many cores work side by side
FRAMES_AT_ONCE = 8
BAKED_FRAMES, POSING_FRAMES = 48, 8  # of which a head is baked to show lips, or to be posed
MOST_COMPARED = 1000  # frames of a person, each with all others: 8 MB of distances


def training_conditioning(
    model: FastModel, datasets: Sequence[HeadDataset]
) -> dict[str, Float[Tensor, "T K"]]:
    """Conditioning of every image of each person, by name.

    Codes decode to the measured lips; where no network learns from lips, they follow the sound.
    """
    device, config, own = model.device, model.config.field, model.field.conditioning
    if config.learns_lips:
        codes = {d.name: supervised_codes(own, d) for d in datasets}
    elif config.use_speech:
        codes = {d.name: dataset_codes(own, d)[d.number.to(device)] for d in datasets}
    else:
        codes = {d.name: torch.zeros(d.frames, config.code_dim) for d in datasets}
    return {
        d.name: torch.cat([codes[d.name].to(device), d.expression.to(device)], -1) for d in datasets
    }


def speech_windows(dataset: HeadDataset, frames: Int[Tensor, " F"]) -> Float[Tensor, "F 8 W D"]:
    """Speech windows of the neighbours of images of a person."""
    return neighbour_windows(dataset.windows, dataset.segment, dataset.number[frames.cpu()])


class FastMethod(Method[RayShare, ReferenceMaps]):
    """A field with an occupancy grid, whose speech networks learn from lip measures.

    Attributes:
        conditioning: of every image of each person of a run, by name.
    """

    model: FastModel
    parallel_shares = SHARES
    segment = 50
    reach = CONTEXT_FRAMES
    refines_poses = True

    def __init__(self, model: FastModel) -> None:
        self.model = model
        self.conditioning: dict[str, Tensor] = {}

    @property
    def references(self) -> int:
        return self.model.config.field.references

    @property
    def speech_dim(self) -> int:
        return self.model.config.field.speech_dim

    @property
    def reference_pool_size(self) -> int:
        return self.model.config.field.reference_pool_size if self.references else 0

    def reference_views(
        self, dataset: HeadDataset, frames: Int[Tensor, " N"], mouths: bool = True
    ) -> ReferenceViews:
        views = cut_references(dataset, frames)
        config = self.model.config.field
        if not (mouths and config.use_speech and config.mouth_views):
            return views
        return replace(views, mouths=self.mouth_views(dataset))

    @torch.no_grad()
    def mouth_views(self, dataset: HeadDataset) -> MouthViews:
        """Crops round the mouths of frames that represent all lips and poses of a person."""
        conditioning = self.model.field.conditioning
        codes = dataset_codes(conditioning, dataset)
        measures = target_lips(conditioning, dataset, codes).cpu()[dataset.number]
        viewpoint = F.normalize(dataset.c2w[:, :, 3], dim=-1)
        lips = dataset.lip_points
        traits = torch.cat([lip_traits(lips, lips), viewpoint / TURN], 1).double()
        compared = min(dataset.frames, MOST_COMPARED)
        some = torch.linspace(0, dataset.frames - 1, compared).round().long()
        distance = torch.cdist(traits[some], traits[some]).square().numpy()
        chosen = sorted(medoids(distance, min(MOUTHS, compared)))
        return cut_mouths(dataset, some[chosen], measures)

    def encode(self, views: ReferenceViews) -> ReferenceMaps:
        maps: ReferenceMaps = self.model.field.encoder(views)
        return maps

    def stored(self, maps: ReferenceMaps) -> ReferenceMaps:
        return maps.as_type(devices.table_type(maps.features.device))

    def learns(self, name: str, config: TrainConfig) -> bool:
        """All but speech networks that learn from lips; the CNN only where `config` says so."""
        if name.startswith("field.conditioning."):
            return not self.model.config.field.lip_supervision
        return config.learn_references_every > 0 or not name.startswith("field.encoder.")

    def begin(
        self,
        datasets: Sequence[HeadDataset],
        held: Sequence[HeadDataset],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        if self.model.config.field.learns_lips and not resumed:
            own = self.model.field.conditioning
            if config.lip_iterations:
                train_speech_networks(own, datasets, config.lip_iterations, generator)
            if len(datasets) == 1:  # a fine-tune
                scale_decoded_lips(own, datasets[0])
        self.conditioning = training_conditioning(self.model, [*datasets, *held])

    def draw_shares(
        self, dataset: HeadDataset, config: TrainConfig, generator: torch.Generator
    ) -> list[RayShare]:
        conditioning = self.conditioning[dataset.name]
        shares = draw_shares(dataset, conditioning, config, generator, SHARES)
        if self.model.config.field.lip_supervision:
            return shares
        windows = [speech_windows(dataset, share.batch.frames) for share in shares]
        pairs = zip(shares, windows, strict=True)
        return [replace(share, windows=w.to(conditioning.device)) for share, w in pairs]

    def share_outcome(
        self,
        share: RayShare,
        maps: ReferenceMaps | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> StepOutcome:
        warp = step >= config.coarse_iterations
        return share_outcome(self.model, share, maps, config, warp, wanted)

    @torch.no_grad()
    def render_batch(
        self, dataset: HeadDataset, batch: RayBatch, maps: ReferenceMaps | None
    ) -> Float[Tensor, "B 3"]:
        conditioning = self.conditioning[dataset.name]
        conditioning = conditioning[batch.frames.to(conditioning.device)]
        if not self.model.config.field.lip_supervision:  # codes change while pictures are learned
            windows = speech_windows(dataset, batch.frames).to(conditioning.device)
            conditioning = self.model.field.conditioning.with_codes(conditioning, windows)
        volume = self.model.volume(conditioning, maps)
        return render_rays(volume, batch.rays).over(batch.background)

    def after_update(self, outcome: StepOutcome) -> None:
        self.model.grid.observe(outcome.points, outcome.weights)

    def after_step(self, step: int, config: TrainConfig) -> None:
        if (step + 1) % config.occupancy_every == 0:
            self.model.grid.refresh()

    def finish(self, dataset: HeadDataset, views: ReferenceViews | None, seed: int) -> None:
        """Fits the person's part of the conditioning, and closes empty cells."""
        model, own = self.model, self.model.field.conditioning
        if model.config.field.learns_lips:
            fit_speaker_adaptation(own, dataset)
        maps = None if views is None else self.maps(views)
        conditioning = training_conditioning(model, [dataset])[dataset.name]
        generator = torch.Generator().manual_seed(seed)
        prune(model.eval(), conditioning, dataset.c2w[:, :, 3].to(model.device), maps, generator)
        self._bake(dataset, maps, BAKED_FRAMES)

    def bake_for_poses(self, dataset: HeadDataset, maps: ReferenceMaps | None) -> None:
        self._bake(dataset, maps, POSING_FRAMES)

    def _bake(self, dataset: HeadDataset, maps: ReferenceMaps | None, count: int) -> None:
        if maps is not None:
            model = self.model.eval()
            conditioning = training_conditioning(model, [dataset])[dataset.name]
            bake(model, conditioning, dataset.c2w[:, :, 3].to(model.device), maps, count)

    @torch.no_grad()
    def resting_heads(
        self,
        expression: Float[Tensor, "F U"],
        origins: Float[Tensor, "F 3"],
        maps: ReferenceMaps | None,
    ) -> Callable[[int], FrameHead]:
        return self._heads(self._resting(expression), origins, maps)

    def _resting(self, expression: Float[Tensor, "F U"]) -> Float[Tensor, "F K"]:
        """Conditioning of frames in silence."""
        model, frames = self.model, len(expression)
        windows = torch.zeros(frames, NEIGHBOURS, WINDOW, self.speech_dim)
        parts = windows, torch.zeros(frames + 2 * CONTEXT_FRAMES, NUMBERS), expression
        resting: Tensor = model.field.conditioning(*(part.to(model.device) for part in parts))
        return resting

    @torch.no_grad()
    def heads_with_lips(
        self,
        expression: Float[Tensor, "F U"],
        lips: Float[Tensor, "F Q 2"],
        origins: Float[Tensor, "F 3"],
        maps: ReferenceMaps | None,
    ) -> Callable[[int], FrameHead]:
        conditioning = self._resting(expression)
        if maps is not None and maps.views.mouths is not None:
            own, mouths = self.model.field.conditioning, maps.views.mouths
            measures = read_measures(mouths, lips.to(conditioning), origins.to(conditioning))
            known = read_measures(mouths, mouths.lips, mouths.views.c2w[:, :, 3])
            measures = measures.clamp(known.amin(0), known.amax(0))
            codes, rest = conditioning.split(
                [self.model.config.field.code_dim, expression.shape[1]], 1
            )
            conditioning = torch.cat([own.project_to_lips(codes, measures), rest], 1)
        return self._heads(conditioning, origins, maps)

    @torch.no_grad()
    def _heads(
        self,
        conditioning: Float[Tensor, "F K"],
        origins: Float[Tensor, "F 3"],
        maps: ReferenceMaps | None,
        baked: bool = True,
    ) -> Callable[[int], FrameHead]:
        """The head of each frame: baked if that is wanted and the person's has been baked."""
        model, images = self.model.rounded(), None
        described = self.model.described(conditioning, origins.to(conditioning))
        if baked and model.baked and maps is not None:
            images = ViewImages.of(maps)

        def head(frame: int) -> FrameHead:
            volume = model.volume(conditioning[frame : frame + 1], maps)
            if images is None:
                return MarchedHead(volume)
            density = model.baked.of_frame(model.grid, described[frame])
            return BakedHead(volume, density, images)

        return head

    @torch.no_grad()
    def speaking_heads(
        self, inputs: FrameInputs, maps: ReferenceMaps | None
    ) -> Callable[[int], FrameHead]:
        """Gives the head of each frame by its number: lips as spoken, `inputs.strength` of them."""
        conditioning = self.model.eval().field.conditioning(
            inputs.windows, inputs.predicted_lips, inputs.expression, inputs.strength, inputs.lips
        )
        return self._heads(conditioning, inputs.c2w[:, :, 3], maps, inputs.baked)

    def render_frames(self, inputs: FrameInputs, maps: ReferenceMaps | None) -> Iterator[HeadImage]:
        """Renders one frame a core at a time on a CPU."""
        heads = self.speaking_heads(inputs, maps)

        def one(t: int) -> tuple[Tensor, Tensor]:
            camera = Camera(inputs.c2w[t], inputs.focal, inputs.centres[t], inputs.size)
            return heads(t).render(camera, None if inputs.regions is None else inputs.regions[t])

        with Workers(inputs.c2w.device, FRAMES_AT_ONCE) as workers:
            yield from workers.map(one, range(inputs.c2w.shape[0]))
