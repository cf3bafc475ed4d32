"""The model of the `fast` preset: a field, and the grid of cells that it occupies.

F frames in a batch, K numbers of conditioning.
"""

from __future__ import annotations

import copy
from typing import Any, ClassVar, Self

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf import device as devices
from dfrf.config import ModelConfig
from dfrf.field.conditioned_field import ConditionedField
from dfrf.field.field import PRIOR_CENTRE, PRIOR_RADII, Field
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.model_interface import HeadModel
from dfrf.rendering.baked_density import BakedDensity
from dfrf.rendering.occupancy import OccupancyGrid
from dfrf.rendering.volume_rendering import Volume

SKIN = (0.7, 1.25)  # of the prior's radii: skin can lie between these


class FastModel(HeadModel):
    """A field and its occupancy grid, every cell of which is open at first.

    Attributes:
        baked: density of a person that has been learned; empty before.
    """

    FAMILY: ClassVar[str] = "fast"
    config: ModelConfig

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.field = Field(config.field)
        self.grid = OccupancyGrid(config.march.resolution)
        self.baked = BakedDensity(config.march.resolution)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        return cls(ModelConfig.from_dict(values))

    def volume(
        self,
        conditioning: Float[Tensor, "F K"],
        maps: ReferenceMaps | None,
        warp: bool = True,
        training_frames: Int[Tensor, " F"] | None = None,
    ) -> Volume:
        """The volume that rays of these frames are sent through.

        Args:
            conditioning: of each frame, see `Conditioning`.
            maps: references; None for a field without them.
            warp: False in the coarse stage.
            training_frames: numbers of the frames in training; None in rendering.
        """
        field = ConditionedField(self.field, conditioning, maps, warp, training_frames)
        return Volume(field, self.grid, self.config.march)

    def described(
        self, conditioning: Float[Tensor, "F K"], origins: Float[Tensor, "F 3"]
    ) -> Float[Tensor, "F D"]:
        """Numbers that the density of frames depends on: lips, upper face, and viewpoint.

        Args:
            conditioning: of each frame, see `Conditioning`.
            origins: of the cameras, head frame.
        """
        config = self.config.field
        code, rest = conditioning.split([config.code_dim, config.expression_dim], 1)
        lips = [self.field.conditioning.lips(code)] if config.use_speech else []
        return torch.cat([*lips, rest, F.normalize(origins, dim=-1)], 1).float()

    def open_where_skin_can_be(self) -> None:
        """Opens the cells near the prior's skin and no others."""
        centre, radii = (self.grid.low.new_tensor(v) for v in (PRIOR_CENTRE, PRIOR_RADII))
        reach = ((self.grid.centres() - centre) / radii).norm(dim=-1)
        self.grid.start_from((reach > SKIN[0]) & (reach < SKIN[1]))

    def rounded(self) -> Self:
        """A copy for rendering, with the field's weights in the type of `device.arithmetic`.

        Otherwise they would be rounded again for every chunk of points.
        """
        copied = copy.deepcopy(self)
        copied.field.to(devices.table_type(self.device))
        # The nearest mouths are found in float32, and so is what a density depends on.
        copied.field.conditioning = self.field.conditioning
        return copied
