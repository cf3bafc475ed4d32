"""SSIM and HaarPSI beside slow, literal readings of their equations."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from dubbing.workshop.lab.metrics.image import haarpsi, ssim


def similarity(first: np.ndarray, second: np.ndarray) -> float:
    """Wang et al. 2004, window by window and channel by channel."""
    bell = np.exp(-(np.arange(-5, 6.0) ** 2) / (2 * 1.5**2))
    weight = np.outer(bell, bell) / bell.sum() ** 2
    found = []
    for row in range(first.shape[0] - 10):
        for column in range(first.shape[1] - 10):
            for channel in range(3):
                a, b = (x[row : row + 11, column : column + 11, channel] for x in (first, second))
                mean_a, mean_b = (weight * a).sum(), (weight * b).sum()
                var_a, var_b = (weight * a**2).sum() - mean_a**2, (weight * b**2).sum() - mean_b**2
                both = (weight * a * b).sum() - mean_a * mean_b
                light = (2 * mean_a * mean_b + 1e-4) / (mean_a**2 + mean_b**2 + 1e-4)
                found.append(light * (2 * both + 9e-4) / (var_a + var_b + 9e-4))
    return float(np.mean(found))


def under(image: np.ndarray, kernel: np.ndarray, row: int, column: int) -> float:
    """Sum of an image under a kernel laid round the corner below right of a pixel."""
    total, half = 0.0, len(kernel) // 2
    for i in range(len(kernel)):
        for j in range(len(kernel)):
            y, x = row + i - half + 1, column + j - half + 1
            if 0 <= y < image.shape[0] and 0 <= x < image.shape[1]:
                total += kernel[i, j] * image[y, x]
    return total


def everywhere(image: np.ndarray, kernel: np.ndarray, stride: int = 1) -> np.ndarray:
    rows, columns = range(0, image.shape[0], stride), range(0, image.shape[1], stride)
    return np.array([[under(image, kernel, y, x) for x in columns] for y in rows])


def literal(first: np.ndarray, second: np.ndarray) -> float:
    """Reisenhofer et al. 2018, with colours, term by term."""
    box = np.full((2, 2), 0.25)
    planes = []
    for image in (first * 255, second * 255):
        r, g, b = image[..., 0], image[..., 1], image[..., 2]
        y = 0.299 * r + 0.587 * g + 0.114 * b
        i = 0.596 * r - 0.274 * g - 0.322 * b
        q = 0.211 * r - 0.523 * g + 0.312 * b
        planes.append([everywhere(plane, box, 2) for plane in (y, i, q)])
    scores, weights = [], []
    for turned in (False, True):
        edges: list[list[np.ndarray]] = []
        for y, _, _ in planes:
            edges.append([])
            for scale in (1, 2, 3):
                haar = np.full((2**scale, 2**scale), 2.0**-scale)
                haar[: 2**scale // 2] *= -1
                edges[-1].append(np.abs(everywhere(y, haar.T if turned else haar)))
        (a1, a2, a3), (b1, b2, b3) = edges
        s1 = (2 * a1 * b1 + 30) / (a1**2 + b1**2 + 30)
        s2 = (2 * a2 * b2 + 30) / (a2**2 + b2**2 + 30)
        scores.append((s1 + s2) / 2)
        weights.append(np.maximum(a3, b3))
    colours = []
    for k in (1, 2):
        a, b = (np.abs(everywhere(plane[k], box)) for plane in planes)
        colours.append((2 * a * b + 30) / (a**2 + b**2 + 30))
    scores.append((colours[0] + colours[1]) / 2)
    weights.append((weights[0] + weights[1]) / 2)
    up = down = 0.0
    for score, weight in zip(scores, weights, strict=True):
        up += (weight / (1 + np.exp(-4.2 * score))).sum()
        down += weight.sum()
    share = up / down
    return float((np.log(share / (1 - share)) / 4.2) ** 2)


def picture(height: int, width: int, seed: int = 0) -> Tensor:
    """Something with edges of every size, in colour, (H, W, 3)."""
    random = torch.Generator().manual_seed(seed)
    total = torch.zeros(1, 3, height, width)
    for side in (2, 4, 8, 16):
        small = torch.rand((1, 3, side, side), generator=random)
        total += F.interpolate(small, size=(height, width), mode="nearest") / 4
    return total[0].permute(1, 2, 0)


def blurred(image: Tensor, sigma: float) -> Tensor:
    at = torch.arange(-12, 13.0)
    bell = torch.exp(-(at**2) / (2 * sigma**2))
    bell = (bell / bell.sum()).repeat(3, 1)
    x = F.pad(image.permute(2, 0, 1)[None], (12, 12, 12, 12), mode="reflect")
    x = F.conv2d(F.conv2d(x, bell[:, None, None], groups=3), bell[:, None, :, None], groups=3)
    return x[0].permute(1, 2, 0)


def test_ssim_is_what_the_equations_say() -> None:
    a, b = picture(26, 31), blurred(picture(26, 31), 1.0)
    expected = similarity(a.double().numpy(), b.double().numpy())
    assert 0.2 < expected < 0.95
    assert ssim(a, b) == pytest.approx(expected, abs=1e-9)
    assert ssim(a, a) == pytest.approx(1)


@pytest.mark.parametrize("size", [(12, 16), (13, 15)])
def test_haarpsi_is_what_the_equations_say(size: tuple[int, int]) -> None:
    a, b = picture(*size), picture(*size, seed=1)
    expected = literal(a.double().numpy(), b.double().numpy())
    assert 0.2 < expected < 0.95
    assert haarpsi(a, b) == pytest.approx(expected, abs=1e-9)


def test_haarpsi_of_equal_pictures_is_one() -> None:
    assert haarpsi(picture(20, 24), picture(20, 24)) == pytest.approx(1)
    assert haarpsi(torch.zeros(9, 9, 3), torch.zeros(9, 9, 3)) == 1


def test_haarpsi_does_not_mind_which_is_the_truth() -> None:
    a, b = picture(31, 40), picture(31, 40, seed=1)
    assert haarpsi(a, b) == pytest.approx(haarpsi(b, a))


def test_haarpsi_falls_with_blur_and_with_noise_at_256() -> None:
    truth = picture(256, 256)
    noise = torch.randn(truth.shape, generator=torch.Generator().manual_seed(2))
    soft = [haarpsi(blurred(truth, sigma), truth) for sigma in (1, 2, 4, 8)]
    rough = [haarpsi((truth + level * noise).clamp(0, 1), truth) for level in (0.02, 0.05, 0.1)]
    for values in (soft, rough):
        assert sorted(values, reverse=True) == values
        assert 1 > values[0] > values[-1] + 0.1 > 0.1
