"""Base class of methods: how training and rendering call a model of any preset.

T frames, F frames in a batch, B rays, M samples, U measures of the upper face, S the image's side
in pixels, D speech features.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.data.ray_batch import RayBatch
from dfrf.field.reference_views import ReferenceViews
from dfrf.model_interface import HeadModel
from dfrf.rendering.frame_buffer import HeadImage
from dfrf.rendering.frame_head import FrameHead


class Share(Protocol):
    """A share of a training step's rays."""

    @property
    def batch(self) -> RayBatch:
        """The rays."""


class Maps(Protocol):
    """References with their features: a dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def features(self) -> Tensor:
        """The features themselves, through which gradients reach the reference network."""


@dataclass(frozen=True)
class StepOutcome:
    """Loss and gradients of a training step, or of a share of one.

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
    """Inputs for rendering the head in T frames in a row.

    Attributes:
        c2w: cameras.
        focal: pixels.
        centres: principal points, (column, row).
        windows: speech windows of each frame's neighbours.
        predicted_lips: P numbers for each of N = T + 2 reach frames: lips predicted from the sound
            without knowing the speaker, and features of the sound; see
            `dfrf.field.speaker_adaptation`.
        expression: measures of the upper face.
        size: S.
        regions: the pixels that are needed; others may be left blank. None is all.
        baked: whether density is looked up, where a person's has been baked, instead of marched.
        strength: of the lips' movement, 1 as spoken, 0 a closed mouth; None as spoken; other than 1
            only where a model has lip measures.
        lips: lip measures in the place of those that the model wants, and how far they are closed,
            0..1; NaN where these stay.
    """

    c2w: Float[Tensor, "T 3 4"]
    focal: float
    centres: Float[Tensor, "T 2"]
    windows: Float[Tensor, "T 8 W D"]
    predicted_lips: Float[Tensor, "N P"]
    expression: Float[Tensor, "T U"]
    size: int
    regions: Bool[Tensor, "T S S"] | None = None
    baked: bool = False
    strength: Float[Tensor, " T"] | None = None
    lips: Float[Tensor, "T C"] | None = None


ShareT = TypeVar("ShareT", bound=Share)
MapsT = TypeVar("MapsT", bound=Maps)


class Method(ABC, Generic[ShareT, MapsT]):
    """How a model of one kind reads references, is trained, and renders.

    Attributes:
        model: that is trained and rendered.
        parallel_shares: largest number of shares of a step that are computed in parallel.
        segment: frames rendered between two saves; a killed run loses no more than these.
        reach: frames before and after the rendered ones whose speech is needed too.
        refines_poses: whether `resting_heads` exist, with which poses are refined.
    """

    model: HeadModel
    parallel_shares: int
    segment: int
    reach: int
    refines_poses: bool = False

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
        """Number of reference views of a person; every view uses N of them."""
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
        """Features in the type they are stored in, where they are read many times."""
        return maps

    @torch.no_grad()
    def maps(self, views: ReferenceViews) -> MapsT:
        """Features of references without a gradient."""
        return self.stored(self.encode(views.to(self.model.device)))

    def learns(self, name: str, config: TrainConfig) -> bool:
        """Whether the parameter of that name is trained on images; by default all are."""
        return True

    def begin(
        self,
        datasets: Sequence[HeadDataset],
        held: Sequence[HeadDataset],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        """Called before the first step of a run; does nothing by default.

        Args:
            datasets: of the people to train on.
            held: of the people held out.
            config: settings.
            generator: of all random numbers.
            resumed: whether the run continues from a saved state.
        """

    @abstractmethod
    def draw_shares(
        self, dataset: HeadDataset, config: TrainConfig, generator: torch.Generator
    ) -> list[ShareT]:
        """Shares of equal size of a step's rays, on the model's device."""

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

        Several threads call it at a time: all random numbers have been drawn before.
        """

    @abstractmethod
    def render_batch(
        self, dataset: HeadDataset, batch: RayBatch, maps: MapsT | None
    ) -> Float[Tensor, "B 3"]:
        """Colours of rays of a person over the background, as the model is; no gradient."""

    def after_update(self, outcome: StepOutcome) -> None:
        """Called after a step whose loss was finite; does nothing by default."""

    def after_step(self, step: int, config: TrainConfig) -> None:
        """Called after every step; does nothing by default."""

    def finish(self, dataset: HeadDataset, views: ReferenceViews | None, seed: int) -> None:
        """Called after the last step of a fine-tune; does nothing by default."""

    def bake_for_poses(self, dataset: HeadDataset, maps: MapsT | None) -> None:
        """Makes a person's density quick to look up, as it is now; does nothing by default."""

    def resting_heads(
        self, expression: Float[Tensor, "F U"], origins: Float[Tensor, "F 3"], maps: MapsT | None
    ) -> Callable[[int], FrameHead]:
        """The head while nobody speaks; gives that of one of F frames.

        Args:
            expression: measures of the upper face.
            origins: of the cameras, head frame.
            maps: references of the person.
        """
        raise NotImplementedError

    def heads_with_lips(
        self,
        expression: Float[Tensor, "F U"],
        lips: Float[Tensor, "F Q 2"],
        origins: Float[Tensor, "F 3"],
        maps: MapsT | None,
    ) -> Callable[[int], FrameHead]:
        """The head with the lips of a film; by default those of `resting_heads`.

        Args:
            expression: measures of the upper face.
            lips: positions of the lips, see `mouth_pixels`.
            origins: of the cameras, head frame.
            maps: references of the person.
        """
        return self.resting_heads(expression, origins, maps)

    @abstractmethod
    def render_frames(self, inputs: FrameInputs, maps: MapsT | None) -> Iterator[HeadImage]:
        """Heads of frames, in their order.

        Yields:
            Premultiplied colour in 0..1, and opacity.
        """
