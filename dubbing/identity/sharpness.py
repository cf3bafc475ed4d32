"""How sharp an image is."""

from __future__ import annotations

import torch
from torch import Tensor


def gradient_energy(image: Tensor) -> float:
    """Mean squared gradient of the luminance of an image (H, W, 3), 0..1."""
    grey = image.double() @ torch.tensor([0.299, 0.587, 0.114], dtype=torch.float64)
    across = grey[:, 1:] - grey[:, :-1]
    down = grey[1:] - grey[:-1]
    return float((across**2).mean() + (down**2).mean())
