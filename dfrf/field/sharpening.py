"""Sharpening by a kernel that undoes a blur of known spread.

N images of H x W pixels.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

BILINEAR_SPREAD = 1 / 3  # px^2 along an axis, by which reading references blurs them


def sharpened(
    images: Float[Tensor, "N H W 3"], spread: float = BILINEAR_SPREAD
) -> Float[Tensor, "N H W 3"]:
    """Images that are as sharp as before once they have been blurred by `spread`.

    Reading between pixels spreads each of them by 1/6 px^2 in the mean, and slightly misplaced
    references spread it about as much again. The kernel (-s/2, 1 + s, -s/2) has the variance -s and
    undoes that. Values may leave 0..1 at edges. The border is replicated outside the images.

    Args:
        images: colours.
        spread: s, px^2 along an axis.
    """
    side = -spread / 2
    line = images.new_tensor([side, 1 - 2 * side, side])
    kernel = torch.outer(line, line).expand(3, 1, 3, 3)
    padded = F.pad(images.permute(0, 3, 1, 2), (1, 1, 1, 1), mode="replicate")
    return F.conv2d(padded, kernel, groups=3).permute(0, 2, 3, 1)
