"""Checkpoints: safetensors with a JSON header, never pickles; and the exact state of a run.

`save_model` / `load_model` keep a finished model; `save_resume` / `load_resume` keep an unfinished
run so that it goes on bit for bit: weights, optimiser, random numbers, step and curve.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

from dfrf.config import FORMATS, TrainConfig
from dfrf.field.model import Model
from dfrf.field.reference_maps import ReferenceViews
from dfrf.head_model import HeadModel
from dfrf.published.model import PaperModel

if TYPE_CHECKING:
    from dfrf.training.fit import Curve
    from dfrf.training.validation import Validation

KINDS: dict[str, type[HeadModel]] = {FORMATS[k.FAMILY]: k for k in (Model, PaperModel)}
STATE_FILE = "state.safetensors"
# Of the settings that a kept state is compared by.
WORDS = {"train": "training", "config": "sizes of the model", "held": "people held out"}


# What is raised where values of a header or tensors are of another kind than they should be.
ODD = (AttributeError, LookupError, OverflowError, RuntimeError, TypeError, ValueError)
# Of a person's references, N of H x W pixels; a letter stands for one number wherever it is.
REFERENCE_SHAPES = {
    "images": ("N", "H", "W", 3),
    "mattes": ("N", "H", "W"),
    "c2w": ("N", 3, 4),
    "centres": ("N", 2),
    "upper": ("N", "U"),
    "eyes": (2, 7),
}


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be used: unreadable, of another kind, or of another run."""


def write_tensors(path: str | Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> None:
    """Writes tensors and a JSON header by write, fsync, rename."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    data = to_bytes(
        {name: value.detach().cpu().contiguous() for name, value in tensors.items()},
        metadata={"dfrf": json.dumps(header, sort_keys=True)},
    )
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError:
        with suppress(OSError):
            partial.unlink()
        raise


def read_tensors(path: str | Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors and JSON header of a file written by `write_tensors`.

    Raises:
        CheckpointError: missing, unreadable, or not written by this tool.
    """
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError, *ODD) as error:
        raise CheckpointError(f"{path}: cannot be read as safetensors: {error}") from error
    if "dfrf" not in metadata:
        raise CheckpointError(f"{path}: is not a checkpoint of this tool")
    try:
        header = json.loads(metadata["dfrf"])
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{path}: its header is no JSON: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(f"{path}: its header holds no keys")
    return tensors, header


def save_model(path: str | Path, model: HeadModel, header: dict[str, Any] | None = None) -> None:
    """Keeps a model: weights, grid, sizes, and what the caller adds to the header."""
    write_tensors(
        path,
        model.state_dict(),
        {"format": FORMATS[model.FAMILY], "config": model.config.to_dict(), **(header or {})},
    )


def load_model(path: str | Path) -> tuple[HeadModel, dict[str, Any]]:
    """A model and the header it was kept with.

    Raises:
        CheckpointError: unreadable, of another format, of sizes that no model has, its tensors do
            not fit its sizes, or hold what is no number.
    """
    tensors, header = read_tensors(path)
    return _build(path, tensors, header), header


def _build(path: str | Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> HeadModel:
    found, known = header.get("format"), " and ".join(map(repr, KINDS))
    kind = KINDS.get(found) if isinstance(found, str) else None
    if kind is None:
        raise CheckpointError(f"{path}: format {found!r:.60}, this version reads {known}")
    try:
        model = kind.from_dict(header.get("config", {}))
    except ODD as error:
        raise CheckpointError(f"{path}: no model has the sizes in its header: {error}") from error
    for name, value in model.state_dict().items():
        if name in tensors and tensors[name].is_floating_point() != value.is_floating_point():
            raise CheckpointError(f"{path}: {name} is of another type than the model's")
    try:
        model.load_state_dict(tensors)
    except RuntimeError as error:
        raise CheckpointError(f"{path}: tensors do not fit the sizes in its header") from error
    weights = dict(model.named_parameters())
    for name, value in model.state_dict().items():
        # Bounds among the buffers may be endless; a weight may not.
        if value.isnan().any() or (name in weights and not value.isfinite().all()):
            raise CheckpointError(f"{path}: {name} holds numbers that are not finite")
    return model


def save_person(
    path: str | Path, model: HeadModel, views: ReferenceViews | None, header: dict[str, Any]
) -> None:
    """Keeps a person's model together with the references it looks at."""
    tensors = model.state_dict()
    if views is not None:
        tensors |= {
            "reference.images": views.images,
            "reference.mattes": views.mattes,
            "reference.c2w": views.c2w,
            "reference.centres": views.centres,
            "reference.upper": views.upper,
            "reference.eyes": views.eyes,
        }
        header = {**header, "focal": views.focal, "scale": views.scale, "blinks": views.blinks}
    about = {"format": FORMATS[model.FAMILY], "config": model.config.to_dict()}
    write_tensors(path, tensors, {**about, **header})


def load_person(path: str | Path) -> tuple[HeadModel, ReferenceViews | None, dict[str, Any]]:
    """A person's model, references (None where the method has none) and header.

    Raises:
        CheckpointError: as `load_model`, or its references are another version's.
    """
    tensors, header = read_tensors(path)
    views = None
    if "reference.images" in tensors:
        part = {k.removeprefix("reference."): v for k, v in tensors.items() if "reference." in k}
        try:
            views = _views(part, header)
        except ODD as error:
            raise CheckpointError(
                f"{path}: keeps other things of its references than this version reads; learn the "
                "person again"
            ) from error
    weights = {k: v for k, v in tensors.items() if not k.startswith("reference.")}
    return _build(path, weights, header), views, header


def _views(part: dict[str, Tensor], header: dict[str, Any]) -> ReferenceViews:
    """References of the shapes and types that they are kept with.

    Raises:
        ValueError, LookupError, TypeError: they are of others.
    """
    lengths: dict[str | int, int] = {}
    for name, shape in REFERENCE_SHAPES.items():
        value = part[name]
        picture = name in ("images", "mattes")
        if value.dtype != (torch.uint8 if picture else torch.float32) or value.isnan().any():
            raise ValueError(name)
        for letter, length in zip(shape, value.shape, strict=True):
            if length != (
                lengths.setdefault(letter, length) if isinstance(letter, str) else letter
            ):
                raise ValueError(name)
    focal, scale, blinks = (header[name] for name in ("focal", "scale", "blinks"))
    if not (0 < focal < math.inf and 0 < scale < math.inf and 0 <= blinks < lengths["N"]):
        raise ValueError("focal, scale, blinks")
    return ReferenceViews(**part, focal=float(focal), scale=float(scale), blinks=int(blinks))


def save_resume(
    folder: str | Path,
    model: HeadModel,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
    config: TrainConfig,
    curve: Curve,
    held: Validation,
    about: Mapping[str, Any],
    step: int,
) -> None:
    """Keeps the whole state of a run after `step` steps, in one file.

    `about`: plain data by name; whoever goes on from the state must say the same.
    """
    tensors = {f"model.{k}": v for k, v in model.state_dict().items()}
    state = optimiser.state_dict()
    for index, values in state["state"].items():
        for name, value in values.items():
            tensors[f"optimiser.{index}.{name}"] = torch.as_tensor(value)
    tensors["generator"] = generator.get_state()
    tensors["curve"] = torch.tensor(curve.rows, dtype=torch.float64)
    tensors["held"] = torch.tensor(held.rows, dtype=torch.float64)
    tensors |= {f"best.{k}": v for k, v in held.best.items()}
    write_tensors(
        Path(folder) / STATE_FILE,
        tensors,
        {"format": FORMATS[model.FAMILY], "step": step, **_settings(model, config, held, about)},
    )


def _settings(
    model: HeadModel, config: TrainConfig, held: Validation, about: Mapping[str, Any]
) -> dict[str, Any]:
    """What two runs have in common if the one can go on from the other's state."""
    own = {"train": asdict(config), "config": model.config.to_dict(), "held": held.names}
    return {**own, **about}


def load_resume(
    folder: str | Path,
    model: HeadModel,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
    config: TrainConfig,
    curve: Curve,
    held: Validation,
    about: Mapping[str, Any],
) -> int:
    """Restores a run in place and returns its step; 0, and nothing is touched, where none is kept.

    Raises:
        CheckpointError: unreadable, damaged, or the state is of a run with other settings, which
            are named.
    """
    path = Path(folder) / STATE_FILE
    if not path.exists():
        return 0
    tensors, header = read_tensors(path)
    settings = _settings(model, config, held, about)
    if others := [key for key, value in settings.items() if header.get(key) != value]:
        named = ", ".join(WORDS.get(key, key) for key in others)
        raise CheckpointError(f"{path}: holds the state of a run with other settings ({named})")
    try:
        return _restore(tensors, header, model, optimiser, generator, curve, held)
    except ODD as error:
        raise CheckpointError(f"{path}: its state is damaged: {error}; remove it") from error


def _restore(
    tensors: dict[str, Tensor],
    header: dict[str, Any],
    model: HeadModel,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
    curve: Curve,
    held: Validation,
) -> int:
    model.load_state_dict(
        {k.removeprefix("model."): v for k, v in tensors.items() if k.startswith("model.")}
    )
    held.best = {k.removeprefix("best."): v for k, v in tensors.items() if k.startswith("best.")}
    held.rows = [tuple(row) for row in tensors["held"].tolist()]
    state = optimiser.state_dict()
    for name, value in tensors.items():
        if name.startswith("optimiser."):
            _, index, key = name.split(".")
            state["state"].setdefault(int(index), {})[key] = value
    optimiser.load_state_dict(state)
    generator.set_state(tensors["generator"])
    curve.rows = [(int(s), a, b, c) for s, a, b, c in tensors["curve"].tolist()]
    return int(header["step"])
