"""Checkpoints of finished models: a base, or a person with the references of their head."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from torch import Tensor

from dfrf.checkpoint import CheckpointError, read_tensors, write_tensors
from dfrf.config import FORMATS
from dfrf.fast.model import FastModel
from dfrf.field.reference_maps import ReferenceViews
from dfrf.head_model import HeadModel
from dfrf.published.model import PaperModel

KINDS: dict[str, type[HeadModel]] = {FORMATS[k.FAMILY]: k for k in (FastModel, PaperModel)}


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
        CheckpointError: unreadable, of another format, or its tensors do not fit its sizes.
    """
    tensors, header = read_tensors(path)
    return _build(path, tensors, header), header


def _build(path: str | Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> HeadModel:
    kind = KINDS.get(header.get("format", ""))
    if kind is None:
        found, known = header.get("format"), " and ".join(map(repr, KINDS))
        raise CheckpointError(
            f"{path}: format {found!r}, this version reads {known}; learn the person again"
        )
    try:
        model = kind.from_dict(header["config"])
        model.load_state_dict(tensors)
    except (TypeError, RuntimeError) as error:
        raise CheckpointError(f"{path}: tensors do not fit the sizes in its header") from error
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
            "reference.expression": views.expression,
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
            views = ReferenceViews(
                **part, focal=header["focal"], scale=header["scale"], blinks=header["blinks"]
            )
        except (KeyError, TypeError) as error:
            raise CheckpointError(
                f"{path}: keeps other things of its references than this version reads; learn the "
                "person again"
            ) from error
    weights = {k: v for k, v in tensors.items() if not k.startswith("reference.")}
    return _build(path, weights, header), views, header
