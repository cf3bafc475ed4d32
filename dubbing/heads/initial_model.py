"""Start of a fine-tune: settings of the training, and a model with the weights of a base."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from dfrf import checkpoint, presets, saved_models
from dfrf.config import PUBLISHED_SPEECH, TrainConfig, family
from dfrf.model_interface import HeadModel
from dubbing.errors import CheckpointError
from dubbing.identity.finetune_settings import FRONT_STEPS, FinetuneSettings
from dubbing.speech import features


def training_settings(settings: FinetuneSettings, preset: TrainConfig, steps: int) -> TrainConfig:
    """Settings of `fit`: those of a preset, with a person's own in their place, for some steps.

    Half of the rays, of half of the frames, are enough for a dub of a head that does not turn.
    """
    own = {"learning_rate": settings.learning_rate, "rays": settings.rays}
    changed: dict[str, Any] = {key: value for key, value in own.items() if value is not None}
    lasting = presets.with_iterations(preset, steps)
    if settings.iterations is None and steps == FRONT_STEPS:
        lasting = replace(lasting, rays=lasting.rays // 2, frames=lasting.frames // 2)
    return replace(lasting, seed=settings.seed, **changed)


def init_from_base(base: Path | None, settings: FinetuneSettings) -> HeadModel:
    """A model to start a person from: the base's weights, warp and occupancy prior included.

    A published checkpoint heard DeepSpeech, by weights it does not name. Where a person hears
    something else, the layer of its AudioNet that reads it begins anew; all else is taken.

    Raises:
        CheckpointError: unreadable, of another preset, or trained with other speech features.
    """
    torch.manual_seed(settings.seed)
    dim = features.features_by_name(settings.speech, settings.weights).dim
    config = presets.model_config(settings.preset, dim, settings.references, settings.warp)
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
