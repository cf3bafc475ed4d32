"""LPIPS beside a literal reading of it, on weights made up on the spot."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import Tensor

from dfrf.checkpoint import CheckpointError
from dubbing.workshop.lab.metrics import lpips

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
def alexnet() -> dict[str, Tensor]:
    """The state dict of AlexNet, as published but for the numbers."""
    random = torch.Generator().manual_seed(0)
    state = {}
    for place, inputs, outputs, side, _, _ in LAYERS:
        spread = (2 / (inputs * side * side)) ** 0.5
        kernel = torch.randn((outputs, inputs, side, side), generator=random) * spread
        state[f"features.{place}.weight"] = kernel
        state[f"features.{place}.bias"] = torch.randn(outputs, generator=random) * 0.1
    state["classifier.6.weight"] = torch.zeros(3, 3)
    return state


@pytest.fixture
def file(alexnet: dict[str, Tensor], tmp_path: Path) -> Path:
    path = tmp_path / "alexnet-owt-7be5be79.pth"
    torch.save(alexnet, path)
    return path


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


def test_lpips_is_what_the_equation_says(alexnet: dict[str, Tensor], file: Path) -> None:
    random = torch.Generator().manual_seed(1)
    a, b = (torch.rand((47, 59, 3), generator=random) for _ in range(2))
    expected = literal(a, b, alexnet, load_file(lpips.HEADS))
    assert expected > 0.01
    assert lpips.load(file, CPU)(a, b) == pytest.approx(expected, rel=1e-4)


def test_lpips_of_equal_pictures_is_nothing_and_it_has_no_side(file: Path) -> None:
    network = lpips.load(file, CPU)
    random = torch.Generator().manual_seed(1)
    a, b = (torch.rand((31, 31, 3), generator=random) for _ in range(2))
    assert network(a, a) == 0
    assert network(a, b) == pytest.approx(network(b, a))


def test_the_shipped_heads_are_those_that_were_published() -> None:
    heads = load_file(lpips.HEADS)
    assert [len(heads[f"lin{k}.model.1.weight"][0]) for k in range(5)] == list(lpips.CHANNELS)
    for weights in heads.values():  # a difference never makes two pictures more alike
        assert weights.min() >= 0
        assert weights.max() > 0
    digest = hashlib.sha256(b"".join(h.numpy().tobytes() for _, h in sorted(heads.items())))
    assert digest.hexdigest()[:16] == "718a8b40b0d22f96"
    card = lpips.HEADS.with_name("LPIPS_CARD.md").read_text()
    assert "Redistributions in binary form must reproduce the above copyright" in card


def test_other_files_are_refused_in_words(alexnet: dict[str, Tensor], tmp_path: Path) -> None:
    def refused(name: str, said: str) -> None:
        with pytest.raises(CheckpointError, match=rf"{name}: {said}.*alexnet-owt"):
            lpips.load(tmp_path / name, CPU)

    refused("nothing.pth", "weights cannot be read")
    (tmp_path / "text.pth").write_text("no weights")
    refused("text.pth", "weights cannot be read")
    torch.save([1, 2], tmp_path / "list.pth")
    refused("list.pth", "not a state dict")
    torch.save(Path("anything but tensors"), tmp_path / "object.pth")
    refused("object.pth", "weights cannot be read")
    torch.save({"lin0.model.1.weight": torch.zeros(1, 64, 1, 1)}, tmp_path / "alex.pth")
    refused("alex.pth", r"no features\.0\.weight in it")
    torch.save({**alexnet, "features.0.weight": torch.zeros(3, 3)}, tmp_path / "other.pth")
    refused("other.pth", "tensors of another network")
