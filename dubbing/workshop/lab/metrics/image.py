"""Image metrics: an image compared with the ground truth. Images are float, 0..1, (H, W, 3)."""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from skimage.metrics import structural_similarity
from torch import Tensor

SSIM_WINDOW = 11
SSIM_SIGMA = 1.5
# Of HaarPSI, fitted by its authors to the judgements of people.
HAARPSI_C = 30.0
HAARPSI_ALPHA = 4.2
# Luminance and two colour differences of R, G, B, with the published digits.
YIQ = ((0.299, 0.587, 0.114), (0.596, -0.274, -0.322), (0.211, -0.523, 0.312))


def psnr(image: Tensor, truth: Tensor) -> float:
    """Peak signal-to-noise ratio in dB; 100 for equal images."""
    mse = float(((image.double() - truth.double()) ** 2).mean())
    return 100.0 if mse < 1e-10 else -10 * math.log10(mse)


def crop(image: Tensor, box: Tensor) -> Tensor:
    """The part of an image inside a box: left, top, right, bottom in pixels."""
    left, top, right, bottom = (int(v) for v in box)
    return image[top:bottom, left:right]


def ssim(image: Tensor, truth: Tensor) -> float:
    """Structural similarity (Wang et al. 2004), Gaussian window 11, sigma 1.5; channel mean.

    Only windows that lie inside the images count; 11 px a side is the least.
    """
    return float(
        structural_similarity(
            image.double().numpy(),
            truth.double().numpy(),
            win_size=SSIM_WINDOW,
            gaussian_weights=True,
            sigma=SSIM_SIGMA,
            use_sample_covariance=False,
            channel_axis=-1,
            data_range=1.0,
        )
    )


def haarpsi(image: Tensor, truth: Tensor) -> float:
    """Haar wavelet perceptual similarity, 0..1 (Reisenhofer et al. 2018); 1 for equal images.

    Edges of 2 and 4 px (at half the resolution, as from a viewer's distance) are compared where
    either image has edges of 8 px, and so are the colours. Images have at least 2 px a side.
    """
    pair = torch.stack([image, truth]).double() * 255
    channels = (pair @ pair.new_tensor(YIQ).T).unbind(-1)
    box = pair.new_full((2, 2), 0.25)
    luminance, *colour = (_correlated(channel, box, stride=2) for channel in channels)
    similar, weights = [], []
    for turned in (False, True):
        edges = [
            _correlated(luminance, haar.T if turned else haar).abs()
            for haar in map(_haar, (2, 4, 8))
        ]
        similar.append((_alike(edges[0]) + _alike(edges[1])) / 2)
        weights.append(edges[2].amax(0))
    orange, purple = (_alike(_correlated(channel, box).abs()) for channel in colour)
    similar.append((orange + purple) / 2)
    weights.append((weights[0] + weights[1]) / 2)
    weight = torch.stack(weights)
    if not weight.any():  # two black images
        return 1.0
    mean = (torch.sigmoid(HAARPSI_ALPHA * torch.stack(similar)) * weight).sum() / weight.sum()
    return float((torch.logit(mean) / HAARPSI_ALPHA) ** 2)


def _haar(side: int) -> Tensor:
    """Haar filter (side, side) of horizontal edges; its transpose is that of vertical ones."""
    half = torch.ones(side // 2, side, dtype=torch.float64) / side
    return torch.cat([-half, half])


def _correlated(images: Tensor, kernel: Tensor, stride: int = 1) -> Tensor:
    """Images (B, H, W) under a kernel of an even side, zeros beyond them.

    Its middle lies half a pixel to the right and below, where the published code has it.
    """
    after = len(kernel) // 2
    padded = F.pad(images, (after - 1, after, after - 1, after))
    return F.conv2d(padded[:, None], kernel[None, None], stride=stride)[:, 0]


def _alike(pair: Tensor) -> Tensor:
    """Similarity of two magnitudes (2, H, W), 0..1."""
    a, b = pair
    return (2 * a * b + HAARPSI_C) / (a**2 + b**2 + HAARPSI_C)


def landmark_distance(rendered: Tensor, truth: Tensor) -> float:
    """LMD: mean distance of landmarks (L, 2), pixels."""
    return float((rendered.double() - truth.double()).norm(dim=-1).mean())
