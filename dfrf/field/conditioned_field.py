"""A field with all its inputs but points: conditioning, references, chosen mouths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.field import mouth_pixels
from dfrf.field.field import Field, FieldOutput
from dfrf.field.reference_maps import ChosenMouths, ReferenceMaps


@dataclass(frozen=True)
class ConditionedField:
    """A field with all its inputs but points, as renderers take it.

    Attributes:
        field: the network.
        conditioning: of each frame.
        maps: references; None for a field without them.
        warp: False in the coarse stage.
        training_frames: numbers of the frames in training, which must not read their own mouths;
            None in rendering.
    """

    field: Field
    conditioning: Float[Tensor, "F K"]
    maps: ReferenceMaps | None
    warp: bool = True
    training_frames: Int[Tensor, " F"] | None = None

    def seen_from(self, origin: Float[Tensor, 3]) -> ConditionedField:
        """The same field with the references nearest to a viewpoint, head frame."""
        if self.maps is None:
            return self
        count = self.field.config.references
        maps = self.maps.select_nearest_views(origin, count)
        return replace(self, maps=replace(maps, chosen=self.chosen_mouths(origin)))

    def chosen_mouths(self, origin: Float[Tensor, 3]) -> tuple[ChosenMouths, ...]:
        """The mouth crops that each frame reads; empty without mouth crops."""
        if self.maps is None or self.maps.mouths is None:
            return ()
        mouths, of_all = self.maps.views.mouths, self.maps.mouths
        assert mouths is not None
        codes = self.conditioning[:, : self.field.config.code_dim].detach()
        with torch.no_grad():
            lips = self.field.conditioning.lips(codes)
        frames = [None] * len(lips) if self.training_frames is None else self.training_frames
        return tuple(
            mouth_pixels.nearest(mouths, of_all, wanted, origin, frame)
            for wanted, frame in zip(lips, frames, strict=True)
        )

    def __call__(
        self,
        points: Float[Tensor, "M 3"],
        directions: Float[Tensor, "M 3"],
        frame: Int[Tensor, " M"],
    ) -> FieldOutput:
        """Density and colour of points, see `Field.forward`."""
        return self.field(points, directions, frame, self.conditioning, self.maps, self.warp)
