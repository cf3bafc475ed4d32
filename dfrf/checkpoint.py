"""The format of checkpoints: safetensors with a JSON header, never pickles.

`saved_models` writes finished models in it, `training.run_state` unfinished runs.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as to_bytes
from torch import Tensor

STATE_FILE = "state.safetensors"
DIGEST = "digest"  # header key: digest of everything else
# Names in messages for the settings that a saved state must agree in.
SETTING_NAMES = {"train": "training", "config": "sizes of the model", "held": "people held out"}

# Raised where a header or tensors hold other values than they should.
MALFORMED_ERRORS = (AttributeError, LookupError, OverflowError, RuntimeError, TypeError, ValueError)


class CheckpointError(RuntimeError):
    """A checkpoint that is unreadable, of another kind, or of another run."""


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
    except (OSError, SafetensorError, *MALFORMED_ERRORS) as error:
        raise CheckpointError(f"{path}: cannot be read as safetensors: {error}") from error
    if "dfrf" not in metadata:
        raise CheckpointError(f"{path}: is not a checkpoint of this tool")
    try:
        header = json.loads(metadata["dfrf"])
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{path}: its header is not JSON: {error}") from error
    if not isinstance(header, dict):
        raise CheckpointError(f"{path}: its header is not a JSON object")
    return tensors, header


def save_state(folder: str | Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> None:
    """Writes the state of an unfinished run."""
    write_tensors(Path(folder) / STATE_FILE, tensors, {**header, DIGEST: _digest(tensors, header)})


def state_is_damaged(folder: str | Path) -> bool:
    """Whether a saved state differs from what was written; False where there is none."""
    try:
        load_state(folder, {})
    except CheckpointError:
        return True
    return False


def _digest(tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> str:
    hasher = hashlib.blake2b(json.dumps(header, sort_keys=True).encode(), digest_size=16)
    for name in sorted(tensors):
        value = tensors[name].detach().cpu().contiguous()
        hasher.update(f"{name} {value.dtype} {tuple(value.shape)}\n".encode())
        hasher.update(value.reshape(-1).view(torch.uint8).numpy().data)
    return hasher.hexdigest()


def load_state(
    folder: str | Path, settings: Mapping[str, Any]
) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
    """Tensors and header of a saved state; None where there is none.

    Args:
        folder: where it was saved.
        settings: entries that its header must hold.

    Raises:
        CheckpointError: unreadable, damaged, or the state is of a run with other settings, which
            are named.
    """
    path = Path(folder) / STATE_FILE
    if not path.exists():
        return None
    tensors, header = read_tensors(path)
    if header.pop(DIGEST, "") != _digest(tensors, header):
        raise CheckpointError(f"{path}: the state in it is damaged; remove it")
    if others := [key for key, value in settings.items() if header.get(key) != value]:
        named = ", ".join(SETTING_NAMES.get(key, key) for key in others)
        raise CheckpointError(f"{path}: holds the state of a run with other settings ({named})")
    return tensors, header
