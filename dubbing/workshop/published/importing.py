"""Reads checkpoints of the published code into ours.

`NNNNNN_head.tar` is a dict of state dicts, written by torch.save. The same tensors may come as
safetensors, named `<state dict>:<tensor>`.
"""

from __future__ import annotations

import pickle
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor

from dfrf.checkpoint import MALFORMED_ERRORS, CheckpointError, write_tensors
from dfrf.config import FORMATS, PUBLISHED_SPEECH
from dfrf.published.conditioned_field import PaperConfig
from dfrf.published.paper_model import PaperModel

COARSE = "network_fn_state_dict"
FINE = "network_fine_state_dict"
WARP = "position_warp_state_dict"
# The aggregation is shared, and stored with each network that it serves.
SHARED = (f"{COARSE}:slot_att.", f"{FINE}:slot_att.", "attention_state_dict:")
# In the published state dicts, but in no equation: nothing ever reads it.
UNUSED = "nerf_model.feature_linear."
# How such a file begins: as a zip archive, or as a pickle where an old torch wrote it.
SAVED_BY_TORCH = (b"PK", b"\x80\x02")

# Published names of our modules.
MODULES = {
    "audio.convolutions.0": "network_audnet_state_dict:encoder_conv.0",
    "audio.convolutions.1": "network_audnet_state_dict:encoder_conv.2",
    "audio.convolutions.2": "network_audnet_state_dict:encoder_conv.4",
    "audio.convolutions.3": "network_audnet_state_dict:encoder_conv.6",
    "audio.hidden": "network_audnet_state_dict:encoder_fc1.0",
    "audio.out": "network_audnet_state_dict:encoder_fc1.2",
    **{
        f"smoothing.convolutions.{i}": f"network_audattnet_state_dict:attentionConvNet.{2 * i}"
        for i in range(5)
    },
    "smoothing.out": "network_audattnet_state_dict:attentionNet.0",
    "field.encoder.conv1": "unet_state_dict:conv1.0",
    "field.encoder.conv2": "unet_state_dict:conv2.0",
    "field.encoder.out": "unet_state_dict:fc",
    "field.warp.layers.0": f"{WARP}:mlp.0",
    "field.warp.layers.1": f"{WARP}:mlp.2",
    "field.warp.out": f"{WARP}:mlp.4",
    **{
        f"field.aggregation.{ours}": f"{SHARED[0]}{theirs}"
        for ours, theirs in {
            "mean": "slots_mu",
            "log_deviation": "slots_logsigma",
            "squeeze1": "fc1.0",
            "squeeze2": "fc6",
            "embed": "fc7.0",
            "norm_input": "norm_input",
            "norm_slots": "norm_slots",
            "norm_mlp": "norm_pre_ff",
            "query": "to_q",
            "key": "to_k",
            "value": "to_v",
            "gru": "gru",
            "mlp1": "mlp.0",
            "mlp2": "mlp.2",
        }.items()
    },
    **{
        f"field.{network}.{ours}": f"{state}:nerf_model.{theirs}"
        for network, state in (("coarse", COARSE), ("fine", FINE))
        for ours, theirs in {
            **{f"layers.{i}": f"pts_linears.{i}" for i in range(8)},
            **{f"colour_layers.{i}": f"views_linears.{i}" for i in range(3)},
            "density": "alpha_linear",
            "colour": "rgb_linear",
        }.items()
    },
}


@dataclass(frozen=True)
class Imported:
    """A published checkpoint that was imported.

    Attributes:
        state: for `PaperModel`.
        step: number of optimiser steps it was trained for; None where the file does not name it.
        warp: False where the file has no warp, and ours starts untrained.
    """

    state: dict[str, Tensor]
    step: int | None
    warp: bool


def published_name(name: str) -> str:
    """`<state dict>:<tensor>` of one of our tensors."""
    if name in MODULES:
        return MODULES[name]
    module, _, tensor = name.rpartition(".")
    return f"{MODULES[module]}.{tensor}"


def read_published(file: Path) -> tuple[dict[str, Tensor], int | None]:
    """Tensors of a published checkpoint as `<state dict>:<tensor>`, and its step.

    Raises:
        CheckpointError: missing, unreadable, or not a published checkpoint.
    """
    if not file.is_file():
        raise CheckpointError(f"{file}: there is no such file")
    step = None
    if file.suffix == ".safetensors":
        try:
            tensors = load_file(file)
        except (OSError, SafetensorError, *MALFORMED_ERRORS) as error:
            raise CheckpointError(f"{file}: cannot be read as safetensors: {error}") from error
    else:
        content = read_torch(file)
        tensors = {
            f"{state}:{name}": tensor
            for state, values in content.items()
            if isinstance(values, dict)
            if str(state).endswith("_state_dict") and not str(state).startswith("optimize")
            for name, tensor in values.items()
            if isinstance(tensor, Tensor)
        }
        step = content.get("global_step")
    if not any(name.startswith(f"{COARSE}:") for name in tensors):
        raise CheckpointError(
            f"{file}: holds no {COARSE}; it is no checkpoint of the published code"
        )
    try:
        return tensors, None if step is None else int(step)
    except MALFORMED_ERRORS as error:
        raise CheckpointError(f"{file}: its global_step is no number of steps") from error


def read_torch(file: Path) -> dict[Any, Any]:
    """The dict in a file written by torch.save; one that holds more than plain data is refused.

    Raises:
        CheckpointError: unreadable.
    """
    with file.open("rb") as opened:
        start = opened.read(2)
    if start not in SAVED_BY_TORCH:
        raise CheckpointError(f"{file}: cannot be read: torch.save has not written it")
    try:
        content = torch.load(file, weights_only=True, map_location="cpu")
    except (pickle.UnpicklingError, EOFError, OSError, MemoryError, *MALFORMED_ERRORS) as error:
        raise CheckpointError(
            f"{file}: cannot be read as weights written by torch.save: {first_line(error)}"
        ) from error
    return content if isinstance(content, dict) else {}


def first_line(error: BaseException) -> str:
    """The message of an error, without the pages of advice that torch adds."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def convert(published: dict[str, Tensor]) -> tuple[dict[str, Tensor], bool]:
    """Our state dict from published tensors, and whether the warp was among them.

    A file without a warp gets an untrained one, the same every time. The aggregation may be stored
    with either network or by itself.

    Raises:
        CheckpointError: names every tensor (or whole state dict) that is missing, has another
            shape, is not finite, is unknown, or is stored twice with different numbers.
    """
    present = {name.partition(":")[0] for name in published}
    has_warp = WARP in present
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        expected = PaperModel(PaperConfig()).state_dict()
    state: dict[str, Tensor] = {}
    problems: list[str] = []
    used: set[str] = set()
    for name, ours in expected.items():
        wanted = published_name(name)
        places = [wanted]
        if wanted.startswith(SHARED[0]):
            places = [place + wanted.removeprefix(SHARED[0]) for place in SHARED]
        used.update(places)
        if wanted.startswith(f"{WARP}:") and not has_warp:
            state[name] = ours
            continue
        copies = [published[place] for place in places if place in published]
        shape = published_shape(name, ours)
        if not copies:
            whole = wanted.partition(":")[0]
            lost = whole not in present and not wanted.startswith(SHARED[0])
            problems.append(f"{whole if lost else wanted} is missing")
        elif wrong := [copy for copy in copies if tuple(copy.shape) != shape]:
            problems.append(f"{wanted} has shape {tuple(wrong[0].shape)}, not {shape}")
        elif not all(map(_plain, copies)):
            problems.append(f"{wanted} does not hold floating point numbers, one beside the other")
        elif not copies[0].float().isfinite().all():
            problems.append(f"{wanted} holds numbers that are not finite")
        elif not all(torch.equal(copies[0].float(), copy.float()) for copy in copies):
            problems.append(f"{wanted} is stored more than once, with different numbers")
        else:
            state[name] = copies[0].detach().to(torch.float32).reshape(ours.shape).clone()
    problems += [
        f"{name} is unknown" for name in published if name not in used and UNUSED not in name
    ]
    if problems:
        raise CheckpointError("not the published model: " + "; ".join(dict.fromkeys(problems)))
    return state, has_warp


def _plain(tensor: Tensor) -> bool:
    """Whether a tensor is dense and of floating point numbers, as weights of layers are."""
    stored = tensor.layout == torch.strided and tensor.device.type == "cpu"
    return stored and tensor.is_floating_point() and not tensor.is_quantized


def published_shape(name: str, ours: Tensor) -> tuple[int, ...]:
    """Shape of one of our tensors in a published file: the slots' start has two more dimensions."""
    start = name.endswith((".mean", ".log_deviation"))
    return (1, 1, *ours.shape) if start else tuple(ours.shape)


def import_checkpoint(file: Path, out: Path) -> Imported:
    """Reads a published checkpoint and writes it as a checkpoint of ours, preset `paper`.

    Args:
        file: `NNNNNN_head.tar`, or a .safetensors with keys `<state dict>:<tensor>`.
        out: the .safetensors to write.

    Raises:
        CheckpointError: unreadable, tensors are missing or of other shapes (all are named), or
            `out` is `file` by another name.
    """
    if out.exists() and file.exists() and out.samefile(file):
        raise CheckpointError(f"{out}: is the file that is read; give another name")
    published, step = read_published(file)
    try:
        state, warp = convert(published)
    except CheckpointError as error:
        raise CheckpointError(f"{file}: {error}") from error
    header = {
        "format": FORMATS["paper"],
        "preset": "paper",
        "speech": PUBLISHED_SPEECH,
        "config": asdict(PaperConfig()),
        "step": step,
        "warp": "imported" if warp else "untrained",
    }
    write_tensors(out, state, header)
    return Imported(state, step, warp)
