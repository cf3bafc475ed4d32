"""Everything that differs between a CPU and a GPU, in one place."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Self

import torch
from torch import Tensor

PADDED_MULTIPLE = 512  # points


class Movable:
    """Base of dataclasses that hold tensors."""

    def to(self, device: torch.device) -> Self:
        """The same on a device: its tensors, and those of its parts that can be moved."""
        parts = vars(self).items()
        moved = {k: v.to(device) for k, v in parts if isinstance(v, Tensor | Movable)}
        return replace(self, **moved)  # type: ignore[type-var]


def choose(name: str = "auto") -> torch.device:
    """The device of `auto`, `cpu` or `cuda`.

    Raises:
        ValueError: another name, or `cuda` where torch sees no GPU.
    """
    if name not in ("auto", "cpu", "cuda"):
        raise ValueError(f"device must be auto, cpu or cuda, not {name!r}")
    if name == "cuda" and not torch.cuda.is_available():
        raise ValueError("device cuda: torch sees no GPU here; use auto or cpu")
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)


def has_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 arithmetic is faster on a device.

    It is on GPUs from Ampere on, and on CPUs with AMX or AVX512-BF16.
    """
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    return torch.cpu._is_amx_tile_supported() or torch.cpu._is_avx512_bf16_supported()


def arithmetic(device: torch.device) -> AbstractContextManager[object]:
    """Autocast for matrix products, where it is faster.

    Threads would share autocast's cache of rounded weights, so it is off. Gradients of the chunks
    are therefore summed in float32 instead of bfloat16.
    """
    return torch.autocast(
        device.type, dtype=torch.bfloat16, enabled=has_bfloat16(device), cache_enabled=False
    )


def matrix_type(device: torch.device) -> torch.dtype:
    """Type that matrix products take here and now: that of `arithmetic` inside of it."""
    if torch.is_autocast_enabled(device.type):
        return torch.get_autocast_dtype(device.type)
    return torch.float32


def table_type(device: torch.device) -> torch.dtype:
    """Type of the look-up tables: half the bytes of float32 where bfloat16 is native."""
    return torch.bfloat16 if has_bfloat16(device) else torch.float32


def chunk_size(device: torch.device) -> int:
    """Points evaluated at once: on a CPU their activations must stay in the cache."""
    return 8192 if device.type == "cpu" else 1 << 18


def padding(count: int) -> int:
    """Number of points that pads `count` to a multiple of `PADDED_MULTIPLE`.

    The matrix library makes a kernel for every new shape, and keeps a thousand of them.
    """
    return -count % PADDED_MULTIPLE


def synchronize(device: torch.device) -> None:
    """Waits for a GPU's queued work, so that timings include it."""
    if device.type == "cuda":
        torch.cuda.synchronize(device)
