"""How good a picture is, beside the picture it should be. Images are float, 0..1, (H, W, 3)."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

SSIM_WINDOW = 11
SSIM_SIGMA = 1.5


def psnr(image: Tensor, truth: Tensor) -> float:
    """Peak signal-to-noise ratio in dB; 100 for equal images."""
    mse = float(((image.double() - truth.double()) ** 2).mean())
    return 100.0 if mse < 1e-10 else -10 * math.log10(mse)


def crop(image: Tensor, box: Tensor) -> Tensor:
    """The part of an image inside a box: left, top, right, bottom in pixels."""
    left, top, right, bottom = (int(v) for v in box)
    return image[top:bottom, left:right]


def ssim(image: Tensor, truth: Tensor) -> float:
    """Structural similarity (Wang et al. 2004), Gaussian window 11, sigma 1.5; channel mean."""
    offsets = torch.arange(SSIM_WINDOW, dtype=torch.float64) - SSIM_WINDOW // 2
    bell = torch.exp(-(offsets**2) / (2 * SSIM_SIGMA**2))
    bell = bell / bell.sum()

    def blur(x: Tensor) -> Tensor:
        x = F.conv2d(x, bell.view(1, 1, 1, -1))
        return F.conv2d(x, bell.view(1, 1, -1, 1))

    a = image.double().permute(2, 0, 1)[:, None]
    b = truth.double().permute(2, 0, 1)[:, None]
    mean_a, mean_b = blur(a), blur(b)
    var_a = blur(a * a) - mean_a**2
    var_b = blur(b * b) - mean_b**2
    covariance = blur(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    luminance = (2 * mean_a * mean_b + c1) / (mean_a**2 + mean_b**2 + c1)
    structure = (2 * covariance + c2) / (var_a + var_b + c2)
    return float((luminance * structure).mean())


def gradient_energy(image: Tensor) -> float:
    """Mean squared gradient of the luminance: how sharp a picture is."""
    grey = image.double() @ torch.tensor([0.299, 0.587, 0.114], dtype=torch.float64)
    across = grey[:, 1:] - grey[:, :-1]
    down = grey[1:] - grey[:-1]
    return float((across**2).mean() + (down**2).mean())


def landmark_distance(found: Tensor, truth: Tensor) -> float:
    """LMD: mean distance of landmarks (L, 2), pixels."""
    return float((found.double() - truth.double()).norm(dim=-1).mean())
