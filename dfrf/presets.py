"""Presets: named configurations of the same modules."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, overload

from dfrf.config import STEPS, AdamConfig, FieldConfig, MarchConfig, ModelConfig, TrainConfig
from dfrf.fast.fast_method import FastMethod
from dfrf.fast.fast_model import FastModel
from dfrf.method_interface import Method
from dfrf.model_interface import HeadModel
from dfrf.published.conditioned_field import PaperConfig
from dfrf.published.paper_method import PaperMethod
from dfrf.published.paper_model import PaperModel

# The one layer of the published model whose size depends on the speech features. Where a base was
# trained with others (DeepSpeech, in a published checkpoint), a fine-tune starts with a new layer.
SPEECH_LAYERS = ("audio.convolutions.0.weight",)
LIP_ITERATIONS = 400  # where the speech networks do not come from a base
BASE_TRAINING = TrainConfig(
    iterations=4000,
    coarse_iterations=3000,
    rays=3072,
    augment=True,
    learn_references_every=4,
    lip_iterations=LIP_ITERATIONS,
)
FINETUNE = TrainConfig(iterations=STEPS["fast"], warmup=20)
PAPER_RATE = 5e-4
PAPER_ADAM = AdamConfig(beta=0.999, epsilon=1e-8, longest=0.0, cosine=False, attention_rate=5.0)


def paper_decay(steps: int) -> float:
    """Factor by which the published rate falls in so many steps."""
    return float(0.1 ** (steps / 750_000))


# The paper's 300,000 + 100,000 steps of 850 rays, split over 17 frames so that the samples of 50
# rays are all that is in memory at once. Rates as published: 5e-4 falls to a tenth in 750,000
# steps; a fine-tune continues from there. As published, one ray of twenty is outside of the head.
PAPER_BASE_TRAINING = TrainConfig(
    iterations=400_000,
    coarse_iterations=300_000,
    rays=850,
    frames=17,
    learning_rate=PAPER_RATE,
    final_rate=paper_decay(400_000),
    warmup=0,
    adam=PAPER_ADAM,
    mouth_share=0.0,
    eyes_share=0.0,
    rim_share=0.0,
    outside_share=0.05,
    learn_references_every=1,
    checkpoint_every=20,
    patience=2500,
)
PAPER_FINETUNE = replace(
    PAPER_BASE_TRAINING,
    iterations=STEPS["paper"],
    coarse_iterations=0,
    learning_rate=PAPER_RATE * paper_decay(400_000),
    final_rate=paper_decay(STEPS["paper"]),
)


@dataclass(frozen=True)
class Trainings:
    """How the models of a preset are trained.

    Attributes:
        base: the shared base.
        finetune: a person, from a base.
        from_scratch: a person, from random weights.
    """

    base: TrainConfig
    finetune: TrainConfig
    from_scratch: TrainConfig


def with_iterations(config: TrainConfig, iterations: int) -> TrainConfig:
    """The same training with another number of steps; the share of coarse steps stays."""
    coarse = math.ceil(iterations * config.coarse_iterations / config.iterations)
    return replace(config, iterations=iterations, coarse_iterations=coarse)


@dataclass(frozen=True)
class Preset:
    """A named configuration of a model, and how it is trained.

    Attributes:
        sizes: of the model; its `preset` and the width of its speech features are filled in.
        trainings: settings of `fit`.
    """

    sizes: FieldConfig | PaperConfig
    trainings: Trainings


FAST_TRAININGS = Trainings(
    base=BASE_TRAINING,
    finetune=FINETUNE,
    from_scratch=replace(FINETUNE, lip_iterations=LIP_ITERATIONS, warmup=TrainConfig.warmup),
)
# From scratch the first stage trains without the warp, as for a base.
PAPER_TRAININGS = Trainings(
    base=PAPER_BASE_TRAINING,
    finetune=PAPER_FINETUNE,
    from_scratch=with_iterations(PAPER_BASE_TRAINING, PAPER_FINETUNE.iterations),
)
PRESETS = {
    "fast": Preset(FieldConfig(), FAST_TRAININGS),
    "fast-alone": Preset(FieldConfig(), FAST_TRAININGS),
    "fast-nocrops": Preset(FieldConfig(mouth_views=False), FAST_TRAININGS),
    "fast-paper": Preset(FieldConfig(mouth_views=False, lip_supervision=False), FAST_TRAININGS),
    "paper": Preset(PaperConfig(), PAPER_TRAININGS),
    "ad-nerf": Preset(FieldConfig(references=0, use_warp=False), FAST_TRAININGS),
    "ad-nerf-nolips": Preset(
        FieldConfig(references=0, use_warp=False, lip_supervision=False), FAST_TRAININGS
    ),
    "nerf": Preset(FieldConfig(references=0, use_warp=False, use_speech=False), FAST_TRAININGS),
}


def preset_named(name: str) -> Preset:
    """The preset of that name.

    Raises:
        ValueError: there is none.
    """
    if name not in PRESETS:
        raise ValueError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    return PRESETS[name]


def trainings(preset: str) -> Trainings:
    """Settings of `fit` for a preset."""
    return preset_named(preset).trainings


def model_config(
    preset: str, speech_dim: int, references: int | None = None, warp: bool = True
) -> ModelConfig | PaperConfig:
    """Sizes of a preset.

    Args:
        preset: its name.
        speech_dim: numbers of the speech features.
        references: a fixed number of references for all frames, in place of the preset's.
        warp: False leaves (3) and (4) out.

    Raises:
        ValueError: an unknown preset, or one whose number of references is fixed.
    """
    sizes = preset_named(preset).sizes
    if not warp:
        sizes = replace(sizes, use_warp=False)
    if isinstance(sizes, PaperConfig):
        if references is not None:
            raise ValueError(f"preset {preset!r} has a fixed number of references")
        return replace(sizes, speech_dim=speech_dim)
    if references is not None:
        if not sizes.references:
            raise ValueError(f"preset {preset!r} has no references")
        sizes = replace(sizes, references=references, reference_pool_size=references)
    field = replace(sizes, speech_dim=speech_dim)
    return ModelConfig(preset=preset, field=field, march=MarchConfig())


@overload
def build(config: ModelConfig) -> FastModel: ...
@overload
def build(config: PaperConfig) -> PaperModel: ...
def build(config: ModelConfig | PaperConfig) -> FastModel | PaperModel:
    """A model with random weights; a grid, where it has one, is open where skin can be."""
    if isinstance(config, PaperConfig):
        return PaperModel(config)
    model = FastModel(config)
    model.open_where_skin_can_be()
    return model


def teacher(model: HeadModel) -> str:
    """Supervision of the speech networks of a model: lips or pictures."""
    lips = isinstance(model, FastModel) and model.config.field.lip_supervision
    return "lips" if lips else "pictures"


@overload
def adapt(base: HeadModel, config: ModelConfig) -> FastModel: ...
@overload
def adapt(base: HeadModel, config: PaperConfig) -> PaperModel: ...
def adapt(base: HeadModel, config: ModelConfig | PaperConfig) -> FastModel | PaperModel:
    """A model of `config` with all tensors that it shares with a base; ablations start from it too.

    Raises:
        ValueError: a base of the other family, which shares none, of other sizes, or whose speech
            networks learned from lips where the model's learn from pictures, or the reverse.
    """
    model = PaperModel(config) if isinstance(config, PaperConfig) else FastModel(config)
    if base.FAMILY != model.FAMILY:
        raise ValueError(f"a model of {model.FAMILY!r} cannot start from one of {base.FAMILY!r}")
    theirs, ours = teacher(base), teacher(model)
    if theirs != ours:
        raise ValueError(f"its speech networks learned from {theirs}, not from {ours}")
    wanted = model.state_dict()
    shared = {
        name: value
        for name, value in base.state_dict().items()
        if name in wanted and (name not in SPEECH_LAYERS or value.shape == wanted[name].shape)
    }
    for name, value in shared.items():
        if value.shape != wanted[name].shape:
            sizes = f"{tuple(value.shape)}, not {tuple(wanted[name].shape)}"
            raise ValueError(f"the base has other sizes: {name} is {sizes}")
    model.load_state_dict({**wanted, **shared})
    return model


def method_of(model: HeadModel) -> Method[Any, Any]:
    """The method that trains and renders a model.

    Raises:
        TypeError: a model of no known kind.
    """
    match model:
        case FastModel():
            return FastMethod(model)
        case PaperModel():
            return PaperMethod(model)
    raise TypeError(f"no method for a {type(model).__name__}")
