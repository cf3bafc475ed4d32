"""Reads and writes finished models: a base, or a person with the references of their head."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from dfrf.checkpoint import MALFORMED_ERRORS, CheckpointError, read_tensors, write_tensors
from dfrf.config import FORMATS
from dfrf.fast.fast_model import FastModel
from dfrf.field.mouth_pixels import LIP_POINTS
from dfrf.field.reference_views import MouthViews, ReferenceViews
from dfrf.field.speaker_adaptation import LIP_MEASURES
from dfrf.model_interface import HeadModel
from dfrf.published.paper_model import PaperModel

KINDS: dict[str, type[HeadModel]] = {FORMATS[k.FAMILY]: k for k in (FastModel, PaperModel)}
# Of a person's references, N of H x W pixels; a letter stands for one number wherever it is.
REFERENCE_SHAPES = {
    "images": ("N", "H", "W", 3),
    "mattes": ("N", "H", "W"),
    "c2w": ("N", 3, 4),
    "centres": ("N", 2),
}
# Of the P crops of h x w pixels round a person's mouth.
MOUTH_SHAPES = {
    "images": ("P", "h", "w", 3),
    "mattes": ("P", "h", "w"),
    "c2w": ("P", 3, 4),
    "centres": ("P", 2),
    "lips": ("P", LIP_POINTS, 2),
    "shape": (LIP_POINTS, 3),
    "reading": (LIP_MEASURES + 4, 2 * LIP_POINTS),
}


def save_model(path: str | Path, model: HeadModel, header: dict[str, Any] | None = None) -> None:
    """Saves a model: weights, grid, sizes, and the caller's entries for the header."""
    save_person(path, model, None, header or {})


def load_model(path: str | Path) -> tuple[HeadModel, dict[str, Any]]:
    """A model and the header it was saved with.

    Raises:
        CheckpointError: unreadable, of another format, of sizes that no model has, its tensors do
            not fit its sizes, or hold NaN.
    """
    tensors, header = read_tensors(path)
    return _build(path, tensors, header), header


def _build(path: str | Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> HeadModel:
    written, known = header.get("format"), " and ".join(map(repr, KINDS))
    kind = KINDS.get(written) if isinstance(written, str) else None
    if kind is None:
        raise CheckpointError(
            f"{path}: format {written!r:.60}, this version reads {known}; "
            "fine-tune the person again"
        )
    try:
        model = kind.from_dict(header.get("config", {}))
    except MALFORMED_ERRORS as error:
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
    """Saves a person's model together with its references."""
    tensors = model.state_dict()
    if views is not None:
        tensors |= {f"reference.{name}": getattr(views, name) for name in REFERENCE_SHAPES}
        header = {**header, "focal": views.focal, "scale": views.scale}
        if views.mouths is not None:
            tensors |= {f"mouth.{name}": value for name, value in _mouth_tensors(views.mouths)}
    about = {"format": FORMATS[model.FAMILY], "config": asdict(model.config)}
    write_tensors(path, tensors, {**about, **header})


def load_person(path: str | Path) -> tuple[HeadModel, ReferenceViews | None, dict[str, Any]]:
    """A person's model, references (None where the method has none) and header.

    Raises:
        CheckpointError: as `load_model`, or its references are another version's.
    """
    tensors, header = read_tensors(path)
    views = None
    if "reference.images" in tensors:
        part, mouth = (
            {k.removeprefix(of): v for k, v in tensors.items() if k.startswith(of)}
            for of in ("reference.", "mouth.")
        )
        try:
            views = _views(part, header)
            if mouth:
                views = replace(views, mouths=_mouths(mouth, views))
        except MALFORMED_ERRORS as error:
            raise CheckpointError(
                f"{path}: its references are in another format than this version reads; fine-tune "
                "the person again"
            ) from error
    weights = {k: v for k, v in tensors.items() if not k.startswith(("reference.", "mouth."))}
    return _build(path, weights, header), views, header


def _mouth_tensors(mouths: MouthViews) -> Iterator[tuple[str, Tensor]]:
    """Tensors of mouth views that are saved, by their name in `MOUTH_SHAPES`."""
    for name in MOUTH_SHAPES:
        yield name, getattr(mouths if hasattr(mouths, name) else mouths.views, name)


def _check(part: dict[str, Tensor], shapes: Mapping[str, Sequence[str | int]]) -> dict[str, int]:
    """Checks shapes and types of tensors, and returns the length that each letter stands for.

    Raises:
        ValueError, LookupError: a tensor has another shape, type or name.
    """
    if part.keys() != shapes.keys():
        raise LookupError("other tensors")
    lengths: dict[str, int] = {}
    for name, shape in shapes.items():
        value = part[name]
        is_image = name in ("images", "mattes")
        if value.dtype != (torch.uint8 if is_image else torch.float32) or value.isnan().any():
            raise ValueError(name)
        for letter, length in zip(shape, value.shape, strict=True):
            if length != (
                lengths.setdefault(letter, length) if isinstance(letter, str) else letter
            ):
                raise ValueError(name)
    return lengths


def _mouths(part: dict[str, Tensor], whole: ReferenceViews) -> MouthViews:
    """Views of a mouth beside the references of the same camera.

    Raises:
        ValueError, LookupError: as `_check`, or there are none.
    """
    count = _check(part, MOUTH_SHAPES)["P"]
    if not count:
        raise ValueError("mouths")
    own: dict[str, Any] = {name: part[name] for name in REFERENCE_SHAPES}
    crops, lips = replace(whole, **own), part["lips"]
    return MouthViews(crops, lips, part["shape"], part["reading"], torch.arange(count), lips[:0])


def _views(part: dict[str, Tensor], header: dict[str, Any]) -> ReferenceViews:
    """References of the shapes and types that they are saved with.

    Raises:
        ValueError, LookupError, TypeError: they have others.
    """
    focal, scale = (header[name] for name in ("focal", "scale"))
    if not (_check(part, REFERENCE_SHAPES)["N"] and 0 < focal < math.inf and 0 < scale < math.inf):
        raise ValueError("no reference, or focal and scale")
    views: dict[str, Any] = {name: part[name] for name in REFERENCE_SHAPES}
    return ReferenceViews(**views, focal=float(focal), scale=float(scale))
