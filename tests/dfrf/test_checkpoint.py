"""Checkpoints: what goes in comes out, and what is not one is refused in words."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from dfrf import presets
from dfrf.checkpoint import CheckpointError, read_tensors, write_tensors
from dfrf.data import cut_references
from dfrf.field import eyelid_deformation
from dfrf.head_checkpoint import load_model, load_person, save_model, save_person
from tests.dfrf.people import person, small_config


def test_a_model_comes_back_with_its_grid_and_header(tmp_path: Path) -> None:
    model = presets.build(small_config())
    save_model(tmp_path / "m.safetensors", model, {"speech": "mel"})
    again, header = load_model(tmp_path / "m.safetensors")
    assert header["speech"] == "mel"
    assert again.config == model.config
    for name, value in model.state_dict().items():
        assert torch.equal(value, again.state_dict()[name])
    assert [p.name for p in tmp_path.iterdir()] == ["m.safetensors"]


def test_a_person_comes_back_with_the_references(tmp_path: Path) -> None:
    model = presets.build(small_config())
    views = cut_references(person(), torch.tensor([1, 4]))
    save_person(tmp_path / "p.safetensors", model, views, {})
    _, again, _ = load_person(tmp_path / "p.safetensors")
    assert again is not None
    assert torch.equal(again.images, views.images)
    assert again.focal == views.focal
    assert torch.equal(again.centres, views.centres)
    assert torch.equal(again.eyes, views.eyes)


def test_the_view_of_a_blink_comes_back_as_such(tmp_path: Path) -> None:
    someone = person()
    someone.expression[2, eyelid_deformation.MEASURES] = -2.0
    views = cut_references(someone, torch.tensor([1, 4]))
    save_person(tmp_path / "p.safetensors", presets.build(small_config()), views, {})
    _, again, _ = load_person(tmp_path / "p.safetensors")
    assert again is not None
    assert (again.blinks, again.closed_eyes) == (1, slice(2, 3))


def test_a_person_of_another_version_is_to_be_learned_again(tmp_path: Path) -> None:
    path = tmp_path / "p.safetensors"
    save_person(
        path, presets.build(small_config()), cut_references(person(), torch.tensor([1])), {}
    )
    tensors, header = read_tensors(path)
    del tensors["reference.eyes"], header["blinks"]
    write_tensors(path, tensors, header)
    with pytest.raises(CheckpointError, match=r"p\.safetensors: .*learn the person again"):
        load_person(path)


@pytest.mark.parametrize("content", [b"", b"not a checkpoint", b"\x80\x04K\x01."])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.safetensors"
    path.write_bytes(content)
    with pytest.raises(CheckpointError, match=r"x\.safetensors"):
        read_tensors(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="nowhere"):
        load_model(tmp_path / "nowhere.safetensors")


def test_safetensors_of_another_tool_are_refused(tmp_path: Path) -> None:
    save_file({"a": torch.zeros(1)}, str(tmp_path / "o.safetensors"))
    with pytest.raises(CheckpointError, match="not a checkpoint of this tool"):
        load_model(tmp_path / "o.safetensors")


def test_tensors_that_do_not_fit_their_header_are_refused(tmp_path: Path) -> None:
    model = presets.build(small_config())
    save_model(tmp_path / "m.safetensors", model)
    tensors, header = read_tensors(tmp_path / "m.safetensors")
    tensors.pop("field.density.weight")
    write_tensors(tmp_path / "m.safetensors", tensors, header)
    with pytest.raises(CheckpointError, match="do not fit"):
        load_model(tmp_path / "m.safetensors")
