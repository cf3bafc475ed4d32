"""Presets: named configurations of the same modules."""

from __future__ import annotations

from dfrf.config import FieldConfig, MarchConfig, ModelConfig, TrainConfig
from dfrf.model import PRIOR_CENTRE, PRIOR_RADII, Model

PRESETS = ("fast", "fast-nowarp", "ad-nerf", "nerf")

LIP_ITERATIONS = 400  # where the speech networks do not come from a base
BASE_TRAINING = TrainConfig(
    iterations=4000,
    coarse_iterations=3000,
    rays=3072,
    augment=True,
    learn_references_every=4,
    lip_iterations=LIP_ITERATIONS,
)
FINETUNE = TrainConfig(iterations=2000)


def model_config(preset: str, speech_dim: int) -> ModelConfig:
    """Sizes of a preset, for speech features of `speech_dim` numbers.

    Raises:
        ValueError: an unknown preset.
    """
    fields = {
        "fast": FieldConfig(speech_dim=speech_dim),
        "fast-nowarp": FieldConfig(speech_dim=speech_dim, use_warp=False),
        "ad-nerf": FieldConfig(speech_dim=speech_dim, references=0, use_warp=False),
        "nerf": FieldConfig(speech_dim=speech_dim, references=0, use_warp=False, use_speech=False),
    }
    if preset not in fields:
        raise ValueError(f"unknown preset {preset!r}; there are {', '.join(PRESETS)}")
    return ModelConfig(preset=preset, field=fields[preset], march=MarchConfig())


def build(config: ModelConfig) -> Model:
    """A model with random weights whose grid is open where the skin of a head can be."""
    model = Model(config)
    centre, radii = (model.grid.low.new_tensor(v) for v in (PRIOR_CENTRE, PRIOR_RADII))
    reach = ((model.grid.centres() - centre) / radii).norm(dim=-1)
    model.grid.start_from((reach > 0.7) & (reach < 1.25))
    return model


def adapt(base: Model, config: ModelConfig) -> Model:
    """A model of `config` with everything it shares with a base: an ablation starts from it too."""
    model = Model(config)
    wanted = model.state_dict()
    shared = {name: value for name, value in base.state_dict().items() if name in wanted}
    model.load_state_dict({**wanted, **shared})
    return model
