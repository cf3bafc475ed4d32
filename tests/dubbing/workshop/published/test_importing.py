from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from torch import Tensor

from dfrf.checkpoint import CheckpointError
from dfrf.published.paper_model import PaperModel
from dfrf.saved_models import load_model
from dubbing.workshop.published.importing import import_checkpoint

LINEAR: dict[str, dict[str, tuple[int, ...]]] = {
    "network": {
        **{f"pts_linears.{i}": (256, 256) for i in range(1, 8)},
        "pts_linears.0": (256, 383),
        "pts_linears.5": (256, 639),
        "views_linears.0": (128, 283),
        "views_linears.1": (128, 128),
        "views_linears.2": (128, 128),
        "feature_linear": (256, 256),
        "alpha_linear": (1, 256),
        "rgb_linear": (3, 128),
    },
    "attention": {
        "to_q": (128, 128),
        "to_k": (128, 128),
        "to_v": (128, 128),
        "mlp.0": (128, 128),
        "mlp.2": (128, 128),
        "fc1.0": (32, 130),
        "fc6": (32, 32),
        "fc7.0": (128, 225),
        "norm_input": (128,),
        "norm_slots": (128,),
        "norm_pre_ff": (128,),
    },
    "unet_state_dict": {"conv1.0": (64, 66, 3, 3), "conv2.0": (64, 64, 3, 3), "fc": (128, 64)},
    "position_warp_state_dict": {"mlp.0": (128, 255), "mlp.2": (32, 128), "mlp.4": (2, 32)},
    "network_audnet_state_dict": {
        "encoder_conv.0": (32, 29, 3),
        "encoder_conv.2": (32, 32, 3),
        "encoder_conv.4": (64, 32, 3),
        "encoder_conv.6": (64, 64, 3),
        "encoder_fc1.0": (64, 64),
        "encoder_fc1.2": (64, 64),
    },
    "network_audattnet_state_dict": {
        "attentionConvNet.0": (16, 32, 3),
        "attentionConvNet.2": (8, 16, 3),
        "attentionConvNet.4": (4, 8, 3),
        "attentionConvNet.6": (2, 4, 3),
        "attentionConvNet.8": (1, 2, 3),
        "attentionNet.0": (8, 8),
    },
}
OTHER = {
    "slots_mu": (1, 1, 128),
    "slots_logsigma": (1, 1, 128),
    "gru.weight_ih": (384, 128),
    "gru.weight_hh": (384, 128),
    "gru.bias_ih": (384,),
    "gru.bias_hh": (384,),
}
# Some of what must land where, ours -> published; the parity test holds all of it.
PLACES = {
    "field.coarse.layers.5.weight": ("network_fn_state_dict", "nerf_model.pts_linears.5.weight"),
    "field.fine.density.bias": ("network_fine_state_dict", "nerf_model.alpha_linear.bias"),
    "field.fine.colour.weight": ("network_fine_state_dict", "nerf_model.rgb_linear.weight"),
    "field.aggregation.key.weight": ("network_fn_state_dict", "slot_att.to_k.weight"),
    "field.aggregation.gru.weight_hh": ("network_fn_state_dict", "slot_att.gru.weight_hh"),
    "field.encoder.conv2.bias": ("unet_state_dict", "conv2.0.bias"),
    "field.warp.out.weight": ("position_warp_state_dict", "mlp.4.weight"),
    "audio.convolutions.3.weight": ("network_audnet_state_dict", "encoder_conv.6.weight"),
    "smoothing.out.bias": ("network_audattnet_state_dict", "attentionNet.0.bias"),
}
Published = dict[str, dict[str, Tensor]]


def layers(shapes: dict[str, tuple[int, ...]]) -> dict[str, Tensor]:
    """Random weights, and biases of the same length."""
    tensors = {f"{name}.weight": torch.randn(shape) for name, shape in shapes.items()}
    return tensors | {f"{name}.bias": torch.randn(shape[0]) for name, shape in shapes.items()}


def published() -> Published:
    """State dicts with the names and shapes of a released checkpoint."""
    attention = layers(LINEAR["attention"])
    attention |= {name: torch.randn(shape) for name, shape in OTHER.items()}
    shared = {f"slot_att.{name}": tensor for name, tensor in attention.items()}

    def network() -> dict[str, Tensor]:
        own = layers(LINEAR["network"])
        return {f"nerf_model.{name}": tensor for name, tensor in own.items()} | shared

    parts = ("unet", "position_warp", "network_audnet", "network_audattnet")
    return {
        "network_fn_state_dict": network(),
        "network_fine_state_dict": network(),
        "attention_state_dict": attention,
        **{f"{part}_state_dict": layers(LINEAR[f"{part}_state_dict"]) for part in parts},
    }


def write_tar(path: Path, content: Published, step: int = 399_999) -> Path:
    """As the published code writes it, an optimiser's state included."""
    weight = torch.nn.Parameter(torch.zeros(2))
    adam = torch.optim.Adam([weight])
    weight.grad = torch.ones(2)
    adam.step()
    extra = {
        "global_step": step,
        "optimizer_state_dict": adam.state_dict(),
        "optimizer_aud_state_dict": adam.state_dict(),
    }
    torch.save({**extra, **content}, path)
    return path


def test_table_is_the_published_one() -> None:
    content = published()
    assert {name: len(tensors) for name, tensors in content.items()} == {
        "network_fn_state_dict": 56,
        "network_fine_state_dict": 56,
        "attention_state_dict": 28,
        "unet_state_dict": 6,
        "position_warp_state_dict": 6,
        "network_audnet_state_dict": 12,
        "network_audattnet_state_dict": 12,
    }
    unique = {id(t): t.numel() for tensors in content.values() for t in tensors.values()}
    assert sum(unique.values()) == 1_957_487


def test_round_trip_through_both_kinds_of_file(tmp_path: Path) -> None:
    content = published()
    tar = write_tar(tmp_path / "400000_head.tar", content)
    flat = {
        f"{state}:{name}": tensor.clone()
        for state, tensors in content.items()
        for name, tensor in tensors.items()
        # The shared attention once, under the coarse network.
        if state != "attention_state_dict"
        and not (state == "network_fine_state_dict" and name.startswith("slot_att."))
    }
    assert len(flat) == 120
    save_file(flat, tmp_path / "flat.safetensors")
    one = import_checkpoint(tar, tmp_path / "one.safetensors")
    other = import_checkpoint(tmp_path / "flat.safetensors", tmp_path / "other.safetensors")
    assert (one.step, one.warp) == (399_999, True)
    assert (other.step, other.warp) == (None, True)
    states = [
        load_model(tmp_path / f"{name}.safetensors")[0].state_dict() for name in ("one", "other")
    ]
    assert states[0].keys() == states[1].keys() == one.state.keys()
    for name, tensor in states[0].items():
        assert torch.equal(tensor, states[1][name])
        assert torch.equal(tensor, one.state[name])
    for ours, (state, theirs) in PLACES.items():
        assert torch.equal(states[0][ours], content[state][theirs])
    # Every published number but the two dead layers is used, once.
    assert sum(t.numel() for t in one.state.values()) == 1_957_487 - 2 * 65_792


def test_a_file_without_a_warp_gets_one_that_does_nothing(tmp_path: Path) -> None:
    content = published()
    del content["position_warp_state_dict"]
    file = write_tar(tmp_path / "base.tar", content)
    results = [import_checkpoint(file, tmp_path / f"{i}.safetensors") for i in range(2)]
    assert not results[0].warp
    assert (tmp_path / "0.safetensors").read_bytes() == (tmp_path / "1.safetensors").read_bytes()
    model, _ = load_model(tmp_path / "0.safetensors")
    assert isinstance(model, PaperModel)
    offset = model.field.warp(torch.rand(3, 63), torch.rand(64), torch.rand(4, 3, 128))
    assert offset.abs().max() < 1e-4


def test_importing_leaves_the_random_numbers_alone(tmp_path: Path) -> None:
    file = write_tar(tmp_path / "a.tar", published())
    torch.manual_seed(7)
    expected = torch.rand(3)
    torch.manual_seed(7)
    import_checkpoint(file, tmp_path / "out.safetensors")
    assert torch.equal(torch.rand(3), expected)


def test_all_that_is_wrong_is_named(tmp_path: Path) -> None:
    content = published()
    del content["network_audnet_state_dict"]
    del content["network_fn_state_dict"]["nerf_model.alpha_linear.bias"]
    content["unet_state_dict"]["fc.weight"] = torch.zeros(64, 64)
    content["network_audattnet_state_dict"]["attentionNet.0.bias"][2] = torch.nan
    content["position_warp_state_dict"]["mlp.6.weight"] = torch.zeros(2)
    content["attention_state_dict"]["to_q.bias"] = torch.zeros(128)
    file = write_tar(tmp_path / "odd.tar", content)
    with pytest.raises(CheckpointError) as error:
        import_checkpoint(file, tmp_path / "out.safetensors")
    message = str(error.value)
    assert message.startswith(f"{file}: not the published model: ")
    for part in (
        "network_audnet_state_dict is missing",
        "network_fn_state_dict:nerf_model.alpha_linear.bias is missing",
        "unet_state_dict:fc.weight has shape (64, 64), not (128, 64)",
        "network_audattnet_state_dict:attentionNet.0.bias holds numbers that are not finite",
        "position_warp_state_dict:mlp.6.weight is unknown",
        "slot_att.to_q.bias is stored more than once, with different numbers",
    ):
        assert message.count(part) == 1
    assert message.count(";") == 5
    assert not (tmp_path / "out.safetensors").exists()


class Dangerous:
    """What no weights file holds."""


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (None, "no such file"),
        (b"some text", "cannot be read"),
        (b"", "cannot be read"),
        (b"PK, but nothing else", "cannot be read"),
        (b"\x80\x02, but nothing else", "cannot be read"),
        ({"model": {"weight": torch.zeros(2)}}, "no network_fn_state_dict"),
        ([torch.zeros(2)], "no network_fn_state_dict"),
        ({"network_fn_state_dict": Dangerous()}, "cannot be read"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: object, match: str) -> None:
    file = tmp_path / "other.tar"
    if isinstance(content, bytes):
        file.write_bytes(content)
    elif content is not None:
        torch.save(content, file)
    with pytest.raises(CheckpointError, match=match):
        import_checkpoint(file, tmp_path / "out.safetensors")


def test_broken_safetensors_and_foreign_checkpoints_are_refused(tmp_path: Path) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"12345678 not json")
    with pytest.raises(CheckpointError, match="cannot be read"):
        import_checkpoint(broken, tmp_path / "out.safetensors")
    save_file({"a": torch.zeros(1)}, tmp_path / "foreign.safetensors")
    with pytest.raises(CheckpointError, match="no network_fn_state_dict"):
        import_checkpoint(tmp_path / "foreign.safetensors", tmp_path / "out.safetensors")
    with pytest.raises(CheckpointError, match="not a checkpoint of this tool"):
        load_model(tmp_path / "foreign.safetensors")


@pytest.mark.parametrize(
    "odd",
    [
        lambda t: t.to_sparse(),
        lambda t: t.to(torch.complex64),
        lambda t: t.to(torch.int64),
        lambda t: torch.quantize_per_tensor(t, 0.1, 0, torch.qint8),
        lambda t: t.to("meta"),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_odd_tensors_are_named(tmp_path: Path, odd: Callable[[Tensor], Tensor]) -> None:
    content = published()
    weights = content["unet_state_dict"]
    weights["fc.weight"] = odd(weights["fc.weight"])
    file = write_tar(tmp_path / "odd.tar", content)
    with pytest.raises(CheckpointError) as error:
        import_checkpoint(file, tmp_path / "out.safetensors")
    assert "unet_state_dict:fc.weight" in str(error.value) or "cannot be read" in str(error.value)


def test_small_floats_are_read(tmp_path: Path) -> None:
    """In eight bits a number cannot even be asked whether it is finite."""
    content = published()
    bias = content["unet_state_dict"]["fc.bias"]
    content["unet_state_dict"]["fc.bias"] = bias.to(torch.float8_e4m3fn)
    file = write_tar(tmp_path / "small.tar", content)
    found = import_checkpoint(file, tmp_path / "out.safetensors")
    assert torch.allclose(found.state["field.encoder.out.bias"], bias, atol=0.2)


@pytest.mark.parametrize("step", ["many", [1, 2], float("inf"), torch.zeros(3)])
def test_an_odd_step_is_said(tmp_path: Path, step: object) -> None:
    file = tmp_path / "odd.tar"
    torch.save({"global_step": step, **published()}, file)
    with pytest.raises(CheckpointError, match=r"odd\.tar: its global_step is no number of steps"):
        import_checkpoint(file, tmp_path / "out.safetensors")


def test_a_checkpoint_is_not_written_onto_itself(tmp_path: Path) -> None:
    file = write_tar(tmp_path / "a.tar", published())
    before = file.read_bytes()
    (tmp_path / "b.tar").hardlink_to(file)
    for out in (file, tmp_path / "b.tar"):
        with pytest.raises(CheckpointError, match="is the file that is read"):
            import_checkpoint(file, out)
    assert file.read_bytes() == before
