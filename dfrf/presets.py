"""Presets: named configurations of the same modules."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import overload

from dfrf.config import (
    FROM_BASE,
    REFERENCE_COUNTS,
    STEPS,
    FieldConfig,
    MarchConfig,
    ModelConfig,
    TrainConfig,
)
from dfrf.field.model import PRIOR_CENTRE, PRIOR_RADII, Model
from dfrf.head_model import HeadModel
from dfrf.published.conditioned_field import PaperConfig
from dfrf.published.model import PaperModel

PAPER = PaperConfig()
PRESETS = (*FROM_BASE, "fast-alone", "paper", "ad-nerf", "nerf")

# The one layer of the published model whose size is that of the speech features: where a base heard
# others (DeepSpeech, in a published checkpoint), a person begins with a new one.
HEARS = ("audio.convolutions.0.weight",)
LIP_ITERATIONS = 400  # where the speech networks do not come from a base
BASE_TRAINING = TrainConfig(
    iterations=4000,
    coarse_iterations=3000,
    rays=3072,
    augment=True,
    learn_references_every=4,
    lip_iterations=LIP_ITERATIONS,
)
FINETUNE = TrainConfig(iterations=STEPS["fast"])
# The paper's 300,000 + 100,000 steps of 850 rays, dealt out to 17 frames so that the samples of 50
# rays are all that is in memory at once. Rates as published: 5e-4 falls to .29 times that in
# 400,000 steps, from where a person goes on.
PAPER_BASE_TRAINING = TrainConfig(
    iterations=400_000,
    coarse_iterations=300_000,
    rays=850,
    frames=17,
    learning_rate=5e-4,
    final_rate=0.3,
    mouth_share=0.25,
    eyes_share=0.1,
    outside_share=0.2,
    learn_references_every=1,
    checkpoint_every=20,
    patience=2500,
)
PAPER_FINETUNE = replace(
    PAPER_BASE_TRAINING,
    iterations=STEPS["paper"],
    coarse_iterations=0,
    learning_rate=1.5e-4,
    final_rate=0.9,
)


@dataclass(frozen=True)
class Trainings:
    """How the models of a preset are trained.

    Attributes:
        base: the shared base.
        finetune: a person, from a base.
        alone: a person, from random weights.
    """

    base: TrainConfig
    finetune: TrainConfig
    alone: TrainConfig


def trainings(preset: str) -> Trainings:
    """Settings of `fit` for a preset."""
    if preset == "paper":
        # Who starts from nothing learns without the warp first, like a base.
        alone = lasting(PAPER_BASE_TRAINING, PAPER_FINETUNE.iterations)
        return Trainings(PAPER_BASE_TRAINING, PAPER_FINETUNE, alone)
    alone = replace(FINETUNE, lip_iterations=LIP_ITERATIONS)
    return Trainings(BASE_TRAINING, FINETUNE, alone)


def lasting(config: TrainConfig, iterations: int) -> TrainConfig:
    """The same training in another number of steps, as large a part of them coarse."""
    coarse = math.ceil(iterations * config.coarse_iterations / config.iterations)
    return replace(config, iterations=iterations, coarse_iterations=coarse)


def model_config(preset: str, speech_dim: int) -> ModelConfig | PaperConfig:
    """Sizes of a preset, for speech features of `speech_dim` numbers.

    Raises:
        ValueError: an unknown preset.
    """
    if preset == "paper":
        return replace(PAPER, speech_dim=speech_dim)
    fast = FieldConfig(speech_dim=speech_dim)
    fields = {
        "fast": fast,
        "fast-alone": fast,
        **{name: replace(fast, references=n, shown=n) for name, n in REFERENCE_COUNTS.items()},
        "fast-nowarp": FieldConfig(speech_dim=speech_dim, use_warp=False),
        "ad-nerf": FieldConfig(speech_dim=speech_dim, references=0, use_warp=False),
        "nerf": FieldConfig(speech_dim=speech_dim, references=0, use_warp=False, use_speech=False),
    }
    if preset not in fields:
        raise ValueError(f"unknown preset {preset!r}; there are {', '.join(PRESETS)}")
    return ModelConfig(preset=preset, field=fields[preset], march=MarchConfig())


@overload
def build(config: ModelConfig) -> Model: ...
@overload
def build(config: PaperConfig) -> PaperModel: ...
def build(config: ModelConfig | PaperConfig) -> Model | PaperModel:
    """A model with random weights; a grid, where it has one, is open where skin can be."""
    if isinstance(config, PaperConfig):
        return PaperModel(config)
    model = Model(config)
    centre, radii = (model.grid.low.new_tensor(v) for v in (PRIOR_CENTRE, PRIOR_RADII))
    reach = ((model.grid.centres() - centre) / radii).norm(dim=-1)
    model.grid.start_from((reach > 0.7) & (reach < 1.25))
    return model


@overload
def adapt(base: HeadModel, config: ModelConfig) -> Model: ...
@overload
def adapt(base: HeadModel, config: PaperConfig) -> PaperModel: ...
def adapt(base: HeadModel, config: ModelConfig | PaperConfig) -> Model | PaperModel:
    """A model of `config` with everything it shares with a base: an ablation starts from it too.

    Raises:
        ValueError: a base of the other family, which shares nothing.
    """
    model = PaperModel(config) if isinstance(config, PaperConfig) else Model(config)
    if base.FAMILY != model.FAMILY:
        raise ValueError(f"a model of {model.FAMILY!r} cannot start from one of {base.FAMILY!r}")
    wanted = model.state_dict()
    shared = {
        name: value
        for name, value in base.state_dict().items()
        if name in wanted and (name not in HEARS or value.shape == wanted[name].shape)
    }
    model.load_state_dict({**wanted, **shared})
    return model
