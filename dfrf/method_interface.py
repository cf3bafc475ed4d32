"""What training and rendering ask of a model: the same questions, whatever its preset.

T frames, F frames in a batch, B rays, M samples, U measures of the upper face, S the picture's side
in pixels, D speech features.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.data.ray_batch import RayBatch
from dfrf.field.reference_views import ReferenceViews
from dfrf.model_interface import HeadModel


class Share(Protocol):
    """What is drawn for a part of a step's rays."""

    @property
    def batch(self) -> RayBatch:
        """The rays."""


class Maps(Protocol):
    """Features of the references."""

    @property
    def features(self) -> Tensor:
        """The features themselves, through which the reference network learns."""

    def with_features(self, features: Tensor) -> Self:
        """The same references with these features."""


@dataclass(frozen=True)
class StepOutcome:
    """What a step, or a share of one, came to.

    Attributes:
        loss, mse: scalars.
        gradients: of the loss, one for each wanted tensor; None where it takes no part.
        points, weights: samples and their rendering weights, head frame.
        rays: B.
    """

    loss: Float[Tensor, ""]
    mse: Float[Tensor, ""]
    gradients: list[Tensor | None]
    points: Float[Tensor, "M 3"]
    weights: Float[Tensor, " M"]
    rays: int


@dataclass(frozen=True)
class FrameInputs:
    """What the heads of T frames in a row are rendered from.

    Attributes:
        c2w: cameras.
        focal: pixels.
        centres: principal points, (column, row).
        windows: speech windows of each frame's neighbours.
        predicted_lips: P numbers, the lips of people in general as predicted from the sound, and
            what is heard, of N = T + 2 reach frames; see `dfrf.field.speaker_adaptation`.
        expression: measures of the upper face.
        size: S.
        regions: the pixels that are needed; others may be left blank. None is all.
    """

    c2w: Float[Tensor, "T 3 4"]
    focal: float
    centres: Float[Tensor, "T 2"]
    windows: Float[Tensor, "T 8 W D"]
    predicted_lips: Float[Tensor, "N P"]
    expression: Float[Tensor, "T U"]
    size: int
    regions: Bool[Tensor, "T S S"] | None = None


ShareT = TypeVar("ShareT", bound=Share)
MapsT = TypeVar("MapsT", bound=Maps)


class Method(ABC, Generic[ShareT, MapsT]):
    """How a model of one kind looks at references, learns, and renders.

    Attributes:
        parallel_shares: shares of a step that are worked on at once, at most.
        segment: frames that are rendered before they are kept: what a kill costs at most.
        reach: frames before and after those to render whose speech is needed too.
    """

    parallel_shares: int
    segment: int
    reach: int

    @property
    @abstractmethod
    def model(self) -> HeadModel:
        """The model that learns and renders."""

    @property
    @abstractmethod
    def references(self) -> int:
        """Number N of reference frames; 0 for a model without references."""

    @property
    @abstractmethod
    def speech_dim(self) -> int:
        """D, numbers of the speech features."""

    @property
    def reference_pool_size(self) -> int:
        """Number of reference views of a person, to choose N from for every view."""
        return self.references

    @abstractmethod
    def reference_views(
        self, dataset: HeadDataset, frames: Int[Tensor, " N"], mouths: bool = True
    ) -> ReferenceViews:
        """Reference views of frames of a person.

        Args:
            dataset: of the person.
            frames: which to take.
            mouths: whether views of the mouth come with them, where the method has such.
        """

    @abstractmethod
    def encode(self, views: ReferenceViews) -> MapsT:
        """Features of references on the model's device, with a gradient to their network."""

    def stored(self, maps: MapsT) -> MapsT:
        """Features that are read again and again, as they are kept."""
        return maps

    @torch.no_grad()
    def maps(self, views: ReferenceViews) -> MapsT:
        """Features of references while their network rests."""
        return self.stored(self.encode(views.to(self.model.device)))

    def learns(self, name: str, config: TrainConfig) -> bool:
        """Whether pictures teach the parameter of that name: all of them do."""
        return True

    def begin(
        self,
        datasets: Sequence[HeadDataset],
        held: Sequence[HeadDataset],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        """What precedes the first step of a run: nothing; less of it where a run is resumed.

        Args:
            datasets: of the people who are learned from.
            held: of those held out.
            config: settings.
            generator: of everything drawn.
            resumed: whether the run goes on from a state.
        """

    @abstractmethod
    def draw_shares(
        self, dataset: HeadDataset, config: TrainConfig, generator: torch.Generator
    ) -> list[ShareT]:
        """Shares of a step's rays, alike in size, on the model's device."""

    @abstractmethod
    def share_outcome(
        self,
        share: ShareT,
        maps: MapsT | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> StepOutcome:
        """Loss of equation (9) over a share, and its gradients for the tensors wanted.

        Called by threads at once: everything random has been drawn before.
        """

    @abstractmethod
    def render_batch(
        self, dataset: HeadDataset, batch: RayBatch, maps: MapsT | None
    ) -> Float[Tensor, "B 3"]:
        """Colours of rays of a person over the background, as the model is; no gradient."""

    def after_update(self, outcome: StepOutcome) -> None:
        """What follows a step whose loss was finite: nothing."""

    def after_step(self, step: int, config: TrainConfig) -> None:
        """What follows every step: nothing."""

    def finish(self, dataset: HeadDataset, views: ReferenceViews | None, seed: int) -> None:
        """What follows the last step of a fine-tune: nothing."""

    @abstractmethod
    def render_frames(
        self, inputs: FrameInputs, maps: MapsT | None
    ) -> Iterator[tuple[Float[Tensor, "S S 3"], Float[Tensor, "S S"]]]:
        """Heads of frames, in their order.

        Yields:
            Premultiplied colour in 0..1, and opacity.
        """
