"""Chooses a person's reference frames in a step, and computes their feature maps."""

from __future__ import annotations

from typing import Any

import torch
from jaxtyping import Int
from torch import Tensor

from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.method_interface import Maps, Method
from dfrf.training.augmentation import Augmentation


class ReferenceSource:
    """Reference maps of the people of a run.

    Args:
        method: of the model that learns.
        config: how often the reference network is trained.
        chosen: fixed reference frames of each person by name; drawn anew each step when None.
    """

    def __init__(
        self, method: Method[Any, Any], config: TrainConfig, chosen: dict[str, Tensor] | None
    ) -> None:
        self.method = method
        self.config = config
        self.chosen = chosen
        self.fixed: dict[str, Maps] = {}

    @property
    def is_constant(self) -> bool:
        """Whether a person's maps are the same in every step."""
        if not self.method.references:
            return True
        changes = self.config.augment or self.config.learn_references_every
        return self.chosen is not None and not changes

    def maps(
        self,
        dataset: HeadDataset,
        exclude: Int[Tensor, " F"],
        generator: torch.Generator,
        step: int,
        augmentation: Augmentation | None = None,
    ) -> Maps | None:
        """Maps of the chosen frames, or of random ones other than `exclude`, as augmented.

        Only every `learn_references_every` steps do maps carry a gradient to the reference network:
        its backward pass costs as much as the rest of the step.
        """
        if not self.method.references:
            return None
        every = self.config.learn_references_every
        if dataset.name in self.fixed:
            return self.fixed[dataset.name]
        if self.chosen is not None:
            views = self.method.reference_views(dataset, self.chosen[dataset.name])
        else:
            frames = random_frames(dataset, self.method.references, exclude, generator)
            views = self.method.reference_views(dataset, frames, mouths=False)
        if augmentation is not None:
            views = augmentation.of_views(views)
        if every > 0 and step % every == 0:
            return self.method.encode(views.to(self.method.model.device))
        maps = self.method.maps(views)
        if self.is_constant:
            self.fixed[dataset.name] = maps
        return maps


def random_frames(
    dataset: HeadDataset, count: int, exclude: Int[Tensor, " F"], generator: torch.Generator
) -> Int[Tensor, " N"]:
    """Random frames of a person, none of `exclude` where there are enough others."""
    order = torch.randperm(dataset.frames, generator=generator)
    others = order[~torch.isin(order, exclude)]
    return (others if len(others) >= count else order)[:count]
