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
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data import Identity, RayBatch
from dfrf.field.reference_maps import ReferenceViews
from dfrf.head_model import HeadModel


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
class Outcome:
    """What a step, or a share of one, came to.

    Attributes:
        loss, mse: scalars.
        gradients: of the loss, one for each tensor asked for; None where it takes no part.
        points, weights: (M, 3) and (M,) samples and their rendering weights, head frame.
        rays: B.
    """

    loss: Tensor
    mse: Tensor
    gradients: list[Tensor | None]
    points: Tensor
    weights: Tensor
    rays: int


ShareT = TypeVar("ShareT", bound=Share)
MapsT = TypeVar("MapsT", bound=Maps)


class Method(ABC, Generic[ShareT, MapsT]):
    """How a model of one kind looks at references, learns, and renders.

    Attributes:
        side_by_side: shares of a step that are worked on at once, at most.
        segment: frames that are rendered before they are kept: what a kill costs at most.
        reach: frames before and after those to render whose speech is asked for too.
    """

    side_by_side: int
    segment: int
    reach: int

    @property
    @abstractmethod
    def model(self) -> HeadModel:
        """The model it speaks for."""

    @property
    @abstractmethod
    def references(self) -> int:
        """Number N of reference frames; 0 for a model without references."""

    @property
    def shown(self) -> int:
        """Number of frames that a person can be shown by, to choose N from for every view."""
        return self.references

    @abstractmethod
    def views(
        self, person: Identity, frames: Tensor, asked: Tensor | None = None
    ) -> ReferenceViews:
        """Reference views of frames (N,) of a person.

        Args:
            asked: frames that the model is to be asked of, which none may be added from.
        """

    @abstractmethod
    def encode(self, views: ReferenceViews) -> MapsT:
        """Features of references on the model's device, with a gradient to their network."""

    @abstractmethod
    def stored(self, maps: MapsT) -> MapsT:
        """Features that are read again and again, as they are kept."""

    @torch.no_grad()
    def maps(self, views: ReferenceViews) -> MapsT:
        """Features of references while their network rests."""
        return self.stored(self.encode(views.to(self.model.device)))

    @abstractmethod
    def learns(self, name: str, config: TrainConfig) -> bool:
        """Whether pictures teach the parameter of that name."""

    @abstractmethod
    def begin(
        self,
        people: Sequence[Identity],
        held: Sequence[Identity],
        config: TrainConfig,
        generator: torch.Generator,
        resumed: bool,
    ) -> None:
        """What precedes the first step of a run; less of it where a run is resumed.

        Args:
            people: who is learned from.
            held: who is held out.
        """

    @abstractmethod
    def draw(
        self, person: Identity, config: TrainConfig, generator: torch.Generator
    ) -> list[ShareT]:
        """Shares of a step's rays, alike in size, on the model's device."""

    @abstractmethod
    def outcome(
        self,
        share: ShareT,
        maps: MapsT | None,
        config: TrainConfig,
        step: int,
        wanted: Sequence[Tensor],
    ) -> Outcome:
        """Loss of equation (9) over a share, and its gradients for the tensors wanted.

        Called by threads at once: everything random has been drawn before.
        """

    @abstractmethod
    def picture(self, person: Identity, batch: RayBatch, maps: MapsT | None) -> Tensor:
        """Colours (B, 3) of rays of a person over the background, as the model is; no gradient."""

    @abstractmethod
    def learned(self, done: Outcome) -> None:
        """Takes note of a step whose loss was finite."""

    @abstractmethod
    def stepped(self, step: int, config: TrainConfig) -> None:
        """What follows every step."""

    @abstractmethod
    def finish(self, person: Identity, views: ReferenceViews | None, seed: int) -> None:
        """What follows the last step of a fine-tune."""

    @abstractmethod
    def frames(
        self,
        c2w: Tensor,
        focal: float,
        centres: Tensor,
        windows: Tensor,
        upper: Tensor,
        maps: MapsT | None,
        size: int,
        regions: Tensor | None = None,
    ) -> Iterator[tuple[Tensor, Tensor]]:
        """Heads of frames, in their order.

        Args:
            c2w: (T, 3, 4); focal in pixels; centres (T, 2).
            windows: (T + 2 reach, 8, 16, D) speech windows of each frame's neighbours.
            upper: (T, U) measures of the upper face.
            maps: reference features.
            size: S.
            regions: (T, S, S) bool, the pixels that are asked for; others may be left blank. None
                is all.

        Yields:
            Premultiplied colour (S, S, 3) in 0..1 and opacity (S, S).
        """
