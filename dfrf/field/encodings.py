"""Frequency encoding of points, directions, colours and camera centres (NeRF, section 5.1)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

# Octaves of the published model: query point, view direction, inputs of the reference CNN.
POINT_OCTAVES = 10
DIRECTION_OCTAVES = 4
REFERENCE_OCTAVES = 5


def encoded_size(octaves: int) -> int:
    """Width of `frequency_encoding` of three numbers: 63 at 10 octaves, 27 at 4."""
    return 3 * (1 + 2 * octaves)


def frequency_encoding(x: Float[Tensor, "... C"], octaves: int) -> Float[Tensor, "... D"]:
    """[x, sin x, cos x, sin 2x, cos 2x, ..., sin 2^(L-1) x, cos 2^(L-1) x], without a factor pi.

    Args:
        x: vectors of C numbers.
        octaves: L, from 0 (the identity).

    Returns:
        Vectors of D = C (1 + 2 L) numbers; each sine and cosine keeps its C numbers together.
    """
    if octaves == 0:
        return x
    scales = 2.0 ** torch.arange(octaves, dtype=x.dtype, device=x.device)
    angles = x[..., None, :] * scales[:, None]
    waves = torch.stack([angles.sin(), angles.cos()], -2)
    return torch.cat([x, waves.flatten(-3)], -1)
