"""The published SyncNet: rule-made weights, and the numbers they must give."""

from pathlib import Path

import numpy as np
import pytest
import torch

from dubbing.errors import SyncError
from dubbing.workshop.lab.syncnet import check as published
from dubbing.workshop.lab.syncnet.syncnet_network import PublishedSyncNet, load_published

pytestmark = pytest.mark.medium


WINDOWS = 25


def rule_state() -> dict[str, torch.Tensor]:
    """Tensor j, element i: s = sin(1 + 0.37 i + 0.11 j), scaled by what the tensor is."""
    state = PublishedSyncNet().state_dict()
    names = [name for name in state if not name.endswith("num_batches_tracked")]
    assert len(names) == 88
    for j, name in enumerate(names):
        tensor = state[name]
        i = torch.arange(tensor.numel(), dtype=torch.float64)
        s = torch.sin(1 + 0.37 * i + 0.11 * j).reshape(tensor.shape)
        if tensor.dim() > 1:
            made = s * 1.5 / (tensor.numel() / len(tensor)) ** 0.5
        elif name.endswith("running_var"):
            made = 1 + 0.5 * s
        elif name.endswith("running_mean") or name.endswith("bias"):
            made = 0.1 * s
        else:
            made = 1 + 0.3 * s
        state[name] = made.float()
    return state


def rule_frames() -> np.ndarray:
    t, y, x, c = np.ogrid[0:30, 0:224, 0:224, 0:3]
    wave = np.sin(0.05 * y * (1 + 0.1 * c) + 0.7 * np.sin(0.9 * t)) * np.cos(0.04 * x - 0.3 * t + c)
    return np.round(127.5 + 127.5 * wave)


def whole_curve(mouth: torch.Tensor, sound: torch.Tensor) -> torch.Tensor:
    """Mean distance at the shifts -15 .. 15 of mouth (n, E) and sound (n, E), (31,)."""
    nothing = sound.new_zeros(15, sound.shape[1])
    return published.shift_rows(mouth, torch.cat([nothing, sound, nothing])).mean(0)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "syncnet_v2.model"
    torch.save(rule_state(), path)
    return path


@pytest.fixture(scope="module")
def embeddings(weights: Path) -> tuple[torch.Tensor, torch.Tensor]:
    # In float32, as it is used; float64 agrees to 3e-6 and takes three times as long.
    network = load_published(weights)
    crops = list(rule_frames())
    mouth = torch.cat(list(published.embed_frames(network, crops)))[:WINDOWS]
    k, n = np.ogrid[0:13, 0:120]
    cepstra = torch.from_numpy(10 * np.sin(0.5 * k + 0.23 * n**1.2)).T.float()
    sound = published.embed_cepstra(network, cepstra)[:WINDOWS]
    return mouth, sound


def test_embeddings(embeddings: tuple[torch.Tensor, torch.Tensor]) -> None:
    mouth, sound = embeddings
    assert mouth.shape == sound.shape == (WINDOWS, 1024)
    expected = {
        (0, 0): [0.831864, -0.257993, -1.089904, -0.959183],
        (0, 24): [0.831594, -0.261046, -1.093214, -0.960011],
        (1, 0): [0.686048, -0.391421, -1.157558, -0.952833],
        (1, 24): [0.685992, -0.391661, -1.157783, -0.952857],
    }
    for (stream, window), values in expected.items():
        assert np.allclose(embeddings[stream][window, :4], values, atol=1e-5, rtol=0)


def test_curve_and_figures(embeddings: tuple[torch.Tensor, torch.Tensor]) -> None:
    curve = whole_curve(*embeddings)
    assert curve.shape == (31,)
    assert np.allclose(curve[:4], [18.165507, 17.114895, 16.062932, 15.010738], atol=1e-5, rtol=0)
    assert np.allclose(curve[14:17], [3.444375, 2.395526, 3.447460], atol=1e-5, rtol=0)
    assert curve[30].item() == pytest.approx(18.166967, abs=1e-5)
    found = published.published_estimate(curve)
    assert found.offset == 0
    assert found.distance == pytest.approx(2.395526, abs=1e-5)
    assert found.confidence == pytest.approx(8.409574, abs=1e-5)


def test_early_audio_has_a_positive_offset() -> None:
    """Sound window i + 3 heard at i + 3 - 2: what belongs to the mouth comes two frames early."""
    generator = torch.Generator().manual_seed(0)
    sound = torch.randn(60, 1024, generator=generator)
    mouth = torch.cat([torch.randn(2, 1024, generator=generator), sound[:-2]])
    assert published.published_estimate(whole_curve(mouth, sound)).offset == 2


def test_curve_is_the_same_in_pieces() -> None:
    generator = torch.Generator().manual_seed(1)
    mouth, sound = torch.randn(2, 47, 1024, generator=generator).double()
    nothing = sound.new_zeros(15, 1024)
    padded = torch.cat([nothing, sound, nothing])
    pieces = [
        published.shift_rows(mouth[a:b], padded[a : b + 30])
        for a, b in ((0, 20), (20, 40), (40, 47))
    ]
    whole = whole_curve(mouth, sound)
    assert torch.allclose(torch.cat(pieces).mean(0), whole, atol=1e-12)


def test_number_of_windows() -> None:
    assert published.windows_of(30, 640 * 30) == 25
    assert published.windows_of(30, 640 * 20 + 639) == 15
    assert published.windows_of(3, 640) == 0


def test_a_file_that_runs_code_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.model"
    torch.save({"network": published.replace}, path)
    with pytest.raises(SyncError, match="cannot be read"):
        load_published(path)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.model"
    torch.save({"a": torch.zeros(3)}, path)
    with pytest.raises(SyncError, match="another network"):
        load_published(path)
    with pytest.raises(SyncError, match="cannot be read"):
        load_published(tmp_path / "missing.model")


def test_crop_reaches_below_the_box_and_is_bgr() -> None:
    frame = np.zeros((400, 400, 3), np.uint8)
    frame[..., 0] = 200
    crop = published.crop_face(frame, np.array([200.0, 100.0, 50.0]))
    assert crop.shape == (224, 224, 3)
    assert (crop[..., 2] == 200).all()
    # Rows 350 - 50 .. 350 + 90: the last 40 of 140 lie below the frame and are grey.
    low = published.crop_face(frame, np.array([200.0, 350.0, 50.0]))
    assert (low[-50:] == 110).all()
    assert (low[:140, :, 2] == 200).all()


def test_boxes_fill_gaps() -> None:
    boxes = np.full((40, 3), np.nan)
    boxes[::2] = [100.0, 80.0, 30.0]
    boxes[10] = [500.0, 80.0, 30.0]
    assert np.allclose(published.face_boxes(boxes), [100, 80, 30])
