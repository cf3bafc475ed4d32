"""Base class of the models of a head: a checkpoint stores them, whatever their preset."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import torch
from torch import nn


class HeadModel(nn.Module, ABC):
    """A model of a head that can be saved, and built again from its sizes.

    Attributes:
        FAMILY: the preset whose bases it can start from, see `config.family`.
        config: its sizes: a dataclass of plain types, for the JSON header of a checkpoint.
    """

    FAMILY: ClassVar[str]
    config: Any

    @classmethod
    @abstractmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """A model of the sizes that `asdict(config)` gave.

        Raises:
            ValueError: a key this version does not know, or a value no model is built with.
        """

    @property
    def device(self) -> torch.device:
        """Where its weights are."""
        return next(self.parameters()).device
