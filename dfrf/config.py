"""Sizes and settings of the method, frozen. A checkpoint's header holds those it was built with.

Lengths are in head units: 1 unit is about 10 cm (the outer eye corners lie 0.9 apart).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, TypeVar

# The two families of presets: the format in the headers of their checkpoints, and the default
# number of steps of a fine-tune.
FORMATS = {"fast": "dfrf-4", "paper": "dfrf-paper-1"}
STEPS = {"fast": 1000, "paper": 40_000}
# Presets that start from the base of `fast`: in training, a base reads no mouth views.
FROM_BASE = ("fast", "fast-nocrops")
PUBLISHED_SPEECH = "deepspeech"  # the speech features of published checkpoints

# Half sizes of the box round the head, head frame, y up, face towards +z. Hair reaches higher than
# the chin reaches low; the centre lies between the ears.
BOX_LOW = (-1.5, -1.8, -1.6)
BOX_HIGH = (1.5, 2.0, 1.5)


def family(preset: str) -> str:
    """The preset whose bases a preset can start from: `fast`, its ablations' too, or `paper`."""
    return "paper" if preset == "paper" else "fast"


# Bounds of the sizes in a header: larger models would fill the memory when they are built.
MAX_SIZE = 2048
MAX_SIZES = {"depth": 32, "resolution": 256, "point_octaves": 32, "direction_octaves": 32}
MIN_SIZES = {"references": 0}
MIN_FLOAT, MAX_FLOAT = 1e-3, 1e6

Sizes = TypeVar("Sizes")


def from_plain(kind: type[Sizes], values: Any) -> Sizes:
    """Sizes of one kind from the plain values in a header; what is left out has its default.

    Raises:
        ValueError: a key this version does not know, or a value no model is built with.
    """
    if not isinstance(values, dict):
        raise ValueError(f"{kind.__name__} must hold keys")
    known = {field.name: field.default for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for name, value in values.items():
        if name not in known:
            raise ValueError(f"{name!r:.40} is unknown")
        wanted = type(known[name])
        if wanted is float and type(value) in (int, float):
            fits = math.isfinite(value) and MIN_FLOAT <= value <= MAX_FLOAT
        elif wanted is int and type(value) is int:
            fits = MIN_SIZES.get(name, 1) <= value <= MAX_SIZES.get(name, MAX_SIZE)
        else:
            fits = type(value) is wanted
        if not fits:
            raise ValueError(f"{name} cannot be {value!r:.40}")
    return kind(**values)


@dataclass(frozen=True)
class FieldConfig:
    """Sizes of the `fast` field.

    Attributes:
        speech_dim: width D of the speech features (windows of 16 x D).
        code_dim: width of the speech code A.
        expression_dim: measures of the upper face that stand beside the code.
        references: number N of references that a point is looked up in; 0 for a field without.
        reference_pool_size: reference views that a person can have; a view uses the N nearest.
        use_speech: False leaves A out (a plain NeRF).
        lip_supervision: False lets the speech networks learn from images, as in AD-NeRF, not
            from lip measures.
        mouth_views: False reads mouths off whole references alone, moved by (3), as in the paper.
        use_warp: False looks references up where they project, equation (1), without (3) and (4).
        feature_dim: channels of the reference features, colour and matte (4) included.
        width, depth: hidden layers of the radiance MLP.
        point_octaves, direction_octaves: frequencies of the encodings.
        max_offset: largest warp offset, pixels at a 512 pixel crop.
    """

    speech_dim: int = 80
    code_dim: int = 64
    expression_dim: int = 6
    references: int = 5
    reference_pool_size: int = 12
    use_speech: bool = True
    lip_supervision: bool = True
    mouth_views: bool = True
    use_warp: bool = True
    feature_dim: int = 32
    cnn_width: int = 24
    token_dim: int = 32
    width: int = 128
    depth: int = 4
    point_octaves: int = 7
    direction_octaves: int = 2
    max_offset: float = 24.0

    @property
    def cond_dim(self) -> int:
        """Width of what the field is conditioned on: the speech code and the upper face."""
        return self.code_dim + self.expression_dim

    @property
    def learns_lips(self) -> bool:
        """Whether there are speech networks that learn from lip measures."""
        return self.use_speech and self.lip_supervision


@dataclass(frozen=True)
class MarchConfig:
    """How rays are sampled: a grid of occupied cells, marched at a fixed step.

    Attributes:
        resolution: cells along each axis of the box.
        step: distance between samples, head units.
        max_samples: samples kept on a ray, the nearest ones.
    """

    resolution: int = 64
    step: float = 0.05
    max_samples: int = 16


@dataclass(frozen=True)
class AdamConfig:
    """Settings of the optimiser; the defaults are those of `fast`.

    Attributes:
        beta, epsilon: the second beta, and what is added to the denominator.
        longest: length that the gradient of a step is cut to; 0 leaves it as it is.
        cosine: the rate falls along half a cosine; False: by the same factor in each step.
        attention_rate: rate of the attention over neighbouring speech codes, times the others'.
    """

    beta: float = 0.99
    epsilon: float = 1e-12
    longest: float = 1.0
    cosine: bool = True
    attention_rate: float = 1.0


@dataclass(frozen=True)
class TrainConfig:
    """Settings of `fit()`; a fine-tune is the base's settings with a few fields replaced.

    Attributes:
        iterations: optimiser steps in all.
        coarse_iterations: steps of the first stage, without the warp (3/4 of them in the paper).
        rays: rays a step, spread over `frames` frames of one person.
        learning_rate: Adam's first rate; it falls to `final_rate` times itself.
        warmup: steps in which the rate rises to that; 0 begins with it.
        adam: other settings of the optimiser.
        warp_weight: lambda of equation (9), in the paper's units (pixels at 512).
        opacity_weight, depth_weight, distortion_weight: what keeps the density compact.
        lip_iterations: steps that train the speech networks on lip measures, before all others.
        mouth_share, eyes_share, rim_share: shares of the rays drawn round the mouth, round the eyes
            and at the head's rim. Where it is 0, these pixels count as any of the head.
        outside_share: share of the rays drawn further out; the rest falls on the head.
        augment: whether each step changes how its person looks (`augmentation`).
        learn_references_every: steps between those in which the reference CNN learns; 0 never.
        occupancy_every: steps between two updates of the occupancy grid.
        checkpoint_every: steps between two saves of the state, and between two measurements on
            people held out.
        patience: number of measurements on people held out without improvement that ends the run.
        seed: of all random numbers in training.
    """

    iterations: int = 1000
    coarse_iterations: int = 0
    rays: int = 3072
    frames: int = 16
    learning_rate: float = 2e-3
    final_rate: float = 0.05
    warmup: int = 100
    adam: AdamConfig = AdamConfig()
    warp_weight: float = 5e-8
    opacity_weight: float = 0.1
    depth_weight: float = 0.05
    distortion_weight: float = 0.01
    lip_iterations: int = 0
    mouth_share: float = 0.35
    eyes_share: float = 0.15
    rim_share: float = 0.15
    outside_share: float = 0.0
    augment: bool = False
    learn_references_every: int = 0
    occupancy_every: int = 20
    checkpoint_every: int = 200
    patience: int = 10
    seed: int = 0

    def checkpoint_due(self, done: int) -> bool:
        """Whether the state is saved and the model is measured after `done` steps."""
        return done % self.checkpoint_every == 0 or done == self.iterations


@dataclass(frozen=True)
class ModelConfig:
    """Sizes of a whole `fast` model."""

    preset: str = "fast"
    march: MarchConfig = dataclasses.field(default_factory=MarchConfig)
    field: FieldConfig = dataclasses.field(default_factory=FieldConfig)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ModelConfig:
        """The inverse of `dataclasses.asdict`.

        Raises:
            ValueError: a key this version does not know or misses, or a value no model is built
                with.
        """
        if not isinstance(values, dict) or {"preset", "field", "march"} != set(values):
            raise ValueError("must hold preset, field and march")
        return cls(
            preset=str(values["preset"]),
            field=from_plain(FieldConfig, values["field"]),
            march=from_plain(MarchConfig, values["march"]),
        )
