"""What a fine-tune starts from: its settings, and a model with the weights of a base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from dfrf import checkpoint, presets, saved_models
from dfrf.config import PUBLISHED_SPEECH, TrainConfig, family
from dfrf.model_interface import HeadModel
from dubbing.errors import CheckpointError
from dubbing.speech import features


@dataclass(frozen=True)
class FinetuneSettings:
    """Settings of an identity's fine-tune.

    Attributes:
        preset: name in `dfrf.presets`.
        iterations: optimiser steps.
        seed: of rays and, without a base, of the weights.
        speech: name of the speech features.
        speech_weights: weights of the user's own for them, a path.
        references: so many in every frame, the same ones, instead of the preset's.
        learning_rate: Adam's first, rays: of a step; None as the preset has them.
    """

    preset: str = "fast"
    iterations: int = presets.FINETUNE.iterations
    seed: int = 0
    speech: str = "rnn"
    speech_weights: str | None = None
    references: int | None = None
    learning_rate: float | None = None
    rays: int | None = None

    @property
    def weights(self) -> Path | None:
        return None if self.speech_weights is None else Path(self.speech_weights)

    def training(self, preset: TrainConfig) -> TrainConfig:
        """Settings of `fit`: the preset's with these in their place."""
        own = {"learning_rate": self.learning_rate, "rays": self.rays}
        changed: dict[str, Any] = {k: v for k, v in own.items() if v is not None}
        return replace(presets.with_iterations(preset, self.iterations), seed=self.seed, **changed)

    def speech_header(self) -> dict[str, str]:
        """What a checkpoint's header holds of its speech features: their name and weights."""
        digest = features.fingerprint(self.speech, self.weights)
        return {"speech": self.speech, **({"speech_digest": digest} if digest else {})}


def init_from_base(base: Path | None, settings: FinetuneSettings) -> HeadModel:
    """A model to start a person from: the base's weights, warp and occupancy prior included.

    A published checkpoint heard DeepSpeech, by weights it does not name. Where a person hears
    something else, the layer of its AudioNet that reads it begins anew; all else is taken.

    Raises:
        CheckpointError: unreadable, of another preset, or trained with other speech features.
    """
    torch.manual_seed(settings.seed)
    dim = features.features_by_name(settings.speech, settings.weights).dim
    config = presets.model_config(settings.preset, dim, settings.references)
    if base is None:
        return presets.build(config)
    try:
        model, header = saved_models.load_model(base)
    except checkpoint.CheckpointError as error:
        raise CheckpointError(str(error), remedy="name another base checkpoint") from error
    if family(settings.preset) != model.FAMILY:
        raise CheckpointError(
            f"is a base of preset {model.FAMILY!r}, wanted {settings.preset!r}",
            base.name,
            "name a base of that preset, or change the preset",
        )
    published = header.get("speech") == PUBLISHED_SPEECH and "speech_digest" not in header
    if not published and header.get("speech") != settings.speech:
        raise CheckpointError(
            f"was trained with {header.get('speech')!r} speech, wanted {settings.speech!r}",
            base.name,
            "use the features the checkpoint was trained with",
        )
    if not published and header.get("speech_digest") != settings.speech_header().get(
        "speech_digest"
    ):
        raise CheckpointError(
            f"was trained with other weights of the {settings.speech!r} speech features",
            base.name,
            "use the weights the checkpoint was trained with",
        )
    try:
        return presets.adapt(model, config)
    except ValueError as error:
        raise CheckpointError(str(error), base.name, "name another base checkpoint") from error
