"""LPIPS beside a literal reading of it, on weights made up on the spot."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from dfrf.checkpoint import CheckpointError
from dfrf.metrics import lpips

# Place in torchvision's `features`, inputs, outputs, kernel, stride and padding of each layer.
LAYERS = (
    (0, 3, 64, 11, 4, 2),
    (3, 64, 192, 5, 1, 2),
    (6, 192, 384, 3, 1, 1),
    (8, 384, 256, 3, 1, 1),
    (10, 256, 256, 3, 1, 1),
)
POOLED_BEFORE = (3, 6)
CPU = torch.device("cpu")


@pytest.fixture
def weights() -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """State dicts of AlexNet and of the heads, as published but for the numbers."""
    random = torch.Generator().manual_seed(0)
    alexnet, heads = {}, {}
    for k, (place, inputs, outputs, side, _, _) in enumerate(LAYERS):
        spread = (2 / (inputs * side * side)) ** 0.5
        kernel = torch.randn((outputs, inputs, side, side), generator=random) * spread
        alexnet[f"features.{place}.weight"] = kernel
        alexnet[f"features.{place}.bias"] = torch.randn(outputs, generator=random) * 0.1
        heads[f"lin{k}.model.1.weight"] = torch.rand((1, outputs, 1, 1), generator=random)
    alexnet["classifier.6.weight"] = torch.zeros(3, 3)
    return alexnet, heads


@pytest.fixture
def files(weights: tuple[dict[str, Tensor], dict[str, Tensor]], tmp_path: Path) -> list[Path]:
    paths = [tmp_path / "alexnet-owt-7be5be79.pth", tmp_path / "alex.pth"]
    for path, state in zip(paths, weights, strict=True):
        torch.save(state, path)
    return paths


def convolved(
    x: np.ndarray, kernel: np.ndarray, bias: np.ndarray, stride: int, pad: int
) -> np.ndarray:
    side = kernel.shape[-1]
    x = np.pad(x, ((0, 0), (pad, pad), (pad, pad)))
    rows, columns = ((n - side) // stride + 1 for n in x.shape[1:])
    out = np.zeros((len(kernel), rows, columns))
    for r in range(rows):
        for c in range(columns):
            window = x[:, r * stride : r * stride + side, c * stride : c * stride + side]
            out[:, r, c] = (kernel * window).sum((1, 2, 3)) + bias
    return out


def pooled(x: np.ndarray) -> np.ndarray:
    rows, columns = ((n - 3) // 2 + 1 for n in x.shape[1:])
    out = np.zeros((len(x), rows, columns))
    for r in range(rows):
        for c in range(columns):
            out[:, r, c] = x[:, 2 * r : 2 * r + 3, 2 * c : 2 * c + 3].max((1, 2))
    return out


def literal(first: Tensor, second: Tensor, alexnet: dict, heads: dict) -> float:
    """Zhang et al. 2018, equation (1), whose squared w are the heads; pictures (H, W, 3), 0..1."""
    shift, scale = np.array([-0.030, -0.088, -0.188]), np.array([0.458, 0.448, 0.450])
    a, b = (
        np.moveaxis((2 * image.double().numpy() - 1 - shift) / scale, -1, 0)
        for image in (first, second)
    )
    total = 0.0
    for k, (place, _, _, _, stride, pad) in enumerate(LAYERS):
        if place in POOLED_BEFORE:
            a, b = pooled(a), pooled(b)
        kernel = alexnet[f"features.{place}.weight"].double().numpy()
        bias = alexnet[f"features.{place}.bias"].double().numpy()
        a, b = (np.maximum(convolved(x, kernel, bias, stride, pad), 0) for x in (a, b))
        of_channel = heads[f"lin{k}.model.1.weight"].double().numpy().ravel()
        places = 0.0
        for r in range(a.shape[1]):
            for c in range(a.shape[2]):
                u = a[:, r, c] / (np.linalg.norm(a[:, r, c]) + 1e-10)
                v = b[:, r, c] / (np.linalg.norm(b[:, r, c]) + 1e-10)
                places += float((of_channel * (u - v) ** 2).sum())
        total += places / (a.shape[1] * a.shape[2])
    return total


def test_lpips_is_what_the_equation_says(
    weights: tuple[dict[str, Tensor], dict[str, Tensor]], files: list[Path]
) -> None:
    random = torch.Generator().manual_seed(1)
    a, b = (torch.rand((47, 59, 3), generator=random) for _ in range(2))
    expected = literal(a, b, *weights)
    assert expected > 0.1
    for order in (files, files[::-1]):
        assert lpips.load(order, CPU)(a, b) == pytest.approx(expected, rel=1e-4)


def test_lpips_of_equal_pictures_is_nothing_and_it_has_no_side(files: list[Path]) -> None:
    network = lpips.load(files, CPU)
    random = torch.Generator().manual_seed(1)
    a, b = (torch.rand((31, 31, 3), generator=random) for _ in range(2))
    assert network(a, a) == 0
    assert network(a, b) == pytest.approx(network(b, a))


def test_other_files_are_refused_in_words(files: list[Path], tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"no lin0\.model\.1\.weight.*alex\.pth"):
        lpips.load(files[:1], CPU)
    with pytest.raises(CheckpointError, match=r"no features\.0\.weight.*alexnet-owt"):
        lpips.load(files[1:], CPU)
    with pytest.raises(CheckpointError, match=r"nothing\.pth"):
        lpips.load([tmp_path / "nothing.pth"], CPU)
    (tmp_path / "text.pth").write_text("no weights")
    with pytest.raises(CheckpointError, match=r"text\.pth: weights cannot be read"):
        lpips.load([tmp_path / "text.pth"], CPU)
    torch.save([1, 2], tmp_path / "list.pth")
    with pytest.raises(CheckpointError, match=r"list\.pth: not a state dict"):
        lpips.load([tmp_path / "list.pth"], CPU)
    torch.save(Path("anything but tensors"), tmp_path / "object.pth")
    with pytest.raises(CheckpointError, match=r"object\.pth: weights cannot be read"):
        lpips.load([tmp_path / "object.pth"], CPU)
    torch.save({"lin0.model.1.weight": torch.zeros(1, 96, 1, 1)}, tmp_path / "vgg.pth")
    with pytest.raises(CheckpointError, match="tensors of another network"):
        lpips.load([*files, tmp_path / "vgg.pth"], CPU)
