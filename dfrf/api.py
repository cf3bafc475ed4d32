"""A person's head: load, fit, save and render it. The starting point for researchers.

N references, W steps of a speech window, D speech features, U measures of the upper face, S the
image's side in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from dfrf import device as devices
from dfrf.cameras import Camera
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.field.audio import NEIGHBOURS, WINDOW
from dfrf.field.reference_views import ReferenceViews
from dfrf.field.speaker_adaptation import NUMBERS
from dfrf.method_interface import FrameInputs, Maps, Method
from dfrf.model_interface import HeadModel
from dfrf.presets import adapt, build, method_of, model_config, trainings
from dfrf.saved_models import load_model, load_person, save_person
from dfrf.training.fit import FitOptions, fit

EXPRESSION = 6  # measures of the upper face


@dataclass(frozen=True)
class Head:
    """A person's model with its references.

    Attributes:
        method: trains and renders the model.
        views: None for a model without references.
        maps: features of the references.
        header: of the checkpoint.
    """

    method: Method[Any, Any]
    views: ReferenceViews | None
    maps: Maps | None
    header: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(
        cls, model: HeadModel, views: ReferenceViews | None, header: dict[str, Any] | None = None
    ) -> Head:
        """A model and its reference views, which are encoded once."""
        method = method_of(model.eval())
        maps = None if views is None else method.maps(views)
        return cls(method, views, maps, header or {})


def load_head(path: str | Path, device: str = "auto") -> Head:
    """A person saved by `dfrf dub` or `save_head`.

    Args:
        path: of `model.safetensors`.
        device: auto, cpu or cuda.

    Raises:
        dfrf.checkpoint.CheckpointError: unreadable, or of another version.
    """
    model, views, header = load_person(path)
    return Head.of(model.to(devices.choose(device)), views, header)


def save_head(path: str | Path, head: Head) -> None:
    """Saves a person as one file."""
    header = {k: v for k, v in head.header.items() if k not in ("format", "config")}
    save_person(path, head.method.model, head.views, header)


def fit_head(
    dataset: HeadDataset,
    references: Int[Tensor, " N"],
    preset: str = "fast",
    base: str | Path | None = None,
    config: TrainConfig | None = None,
    device: str = "auto",
) -> Head:
    """Fits a head to a person's frames.

    Args:
        dataset: of the person.
        references: frames of it that become references; unused by presets without.
        preset: of the model, see `dfrf.presets`.
        base: checkpoint to start from; None starts from random weights.
        config: settings; the preset's by default.
        device: auto, cpu or cuda.

    Raises:
        TrainingDivergedError: the loss was not finite for several steps in a row.
        dfrf.checkpoint.CheckpointError: the base cannot be read.
    """
    sizes = model_config(preset, dataset.windows.shape[-1])
    model = build(sizes) if base is None else adapt(load_model(base)[0], sizes)
    default = trainings(preset)
    config = config or (default.from_scratch if base is None else default.finetune)
    method = method_of(model)
    chosen = {dataset.name: references} if method.references else None
    fit(method, [dataset], config, chosen, FitOptions(device=device))
    views = method.reference_views(dataset, references) if method.references else None
    method.finish(dataset, views, config.seed)
    return Head.of(model, views)


def render_frame(
    head: Head,
    camera: Camera,
    windows: Float[Tensor, "1 8 W D"] | None = None,
    predicted_lips: Float[Tensor, "N P"] | None = None,
    expression: Float[Tensor, "1 U"] | None = None,
) -> tuple[Float[Tensor, "S S 3"], Float[Tensor, "S S"]]:
    """One frame of a head.

    Args:
        head: to render.
        camera: head frame.
        windows: speech windows of the frame and of its neighbours; silence when None.
        predicted_lips: of the frame and of `reach` frames to each side, see
            `dfrf.field.speaker_adaptation`; zeros when None.
        expression: measures of the upper face; a face at rest when None.

    Returns:
        Premultiplied colour in 0..1, and opacity: `colour + (1 - opacity[..., None]) * background`
        is the image.
    """
    method = head.method
    device = method.model.device
    if windows is None:
        windows = torch.zeros(1, NEIGHBOURS, WINDOW, method.speech_dim)
    if predicted_lips is None:
        predicted_lips = torch.zeros(1 + 2 * method.reach, NUMBERS)
    if expression is None:
        expression = torch.zeros(1, EXPRESSION)
    inputs = FrameInputs(
        camera.c2w[None].to(device),
        camera.focal,
        camera.centre[None].to(device),
        windows.to(device),
        predicted_lips.to(device),
        expression.to(device),
        camera.size,
    )
    return next(iter(method.render_frames(inputs, head.maps)))
