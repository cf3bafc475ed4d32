"""Checkpoints: what goes in comes out, and what is not one is refused in words."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from dfrf import presets
from dfrf.checkpoint import (
    STATE_FILE,
    CheckpointError,
    load_state,
    read_tensors,
    save_state,
    state_is_damaged,
    write_tensors,
)
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_method import FastMethod
from dfrf.saved_models import load_model, load_person, save_model, save_person
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


def test_the_views_of_a_mouth_come_back(tmp_path: Path) -> None:
    method = FastMethod(presets.build(small_config()))
    views = method.reference_views(person(), torch.tensor([1, 4]))
    save_person(tmp_path / "p.safetensors", method.model, views, {})
    _, again, _ = load_person(tmp_path / "p.safetensors")
    assert again is not None
    assert views.mouths is not None
    assert again.mouths is not None
    for name in ("lips", "shape", "reading"):
        assert torch.equal(getattr(again.mouths, name), getattr(views.mouths, name))
    assert torch.equal(again.mouths.views.images, views.mouths.views.images)
    before, after = method.maps(views).mouths, method.maps(again).mouths
    assert before is not None
    assert after is not None
    assert torch.equal(before.features, after.features)


def test_a_person_of_another_version_is_to_be_learned_again(tmp_path: Path) -> None:
    path = tmp_path / "p.safetensors"
    save_person(
        path, presets.build(small_config()), cut_references(person(), torch.tensor([1])), {}
    )
    tensors, header = read_tensors(path)
    del tensors["reference.centres"], header["scale"]
    write_tensors(path, tensors, header)
    with pytest.raises(CheckpointError, match=r"p\.safetensors: .*fine-tune the person again"):
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


@pytest.mark.parametrize(
    "header",
    [
        "[]",
        "3",
        "[" * 99_999,
        "{",
        '{"format": ["dfrf-1"]}',
        '{"format": "dfrf-1"}',
        '{"format": "dfrf-1", "config": 3}',
        '{"format": "dfrf-paper-1", "config": []}',
        '{"format": "dfrf-1", "config": {"preset": "fast", "field": 3, "march": {}}}',
    ],
)
def test_an_odd_header_is_refused(tmp_path: Path, header: str) -> None:
    path = tmp_path / "odd.safetensors"
    save_file({"a": torch.zeros(1)}, str(path), {"dfrf": header})
    for load in (load_model, load_person):
        with pytest.raises(CheckpointError, match=r"odd\.safetensors"):
            load(path)


@pytest.mark.parametrize(
    ("part", "name", "value"),
    [
        ("field", "width", -1),
        ("field", "width", 10**9),
        ("field", "width", "128"),
        ("field", "width", True),
        ("field", "depth", 10**9),
        ("field", "depth", None),
        ("field", "use_warp", 1),
        ("field", "unknown", 1),
        ("field", "max_offset", float("nan")),
        ("march", "resolution", 10**9),
        ("march", "resolution", 0),
        ("march", "step", 0.0),
        ("march", "max_samples", 1.5),
    ],
)
def test_sizes_that_no_model_has_are_refused(
    tmp_path: Path, part: str, name: str, value: object
) -> None:
    path = tmp_path / "m.safetensors"
    save_model(path, presets.build(small_config()))
    tensors, header = read_tensors(path)
    header["config"][part][name] = value
    write_tensors(path, tensors, header)
    with pytest.raises(CheckpointError, match=rf"no model has the sizes in its header: .*{name}"):
        load_model(path)


@pytest.mark.parametrize("number", [torch.nan, torch.inf])
def test_weights_that_are_not_finite_are_refused(tmp_path: Path, number: float) -> None:
    model = presets.build(small_config())
    with torch.no_grad():
        model.field.density.bias.fill_(number)
    save_model(tmp_path / "m.safetensors", model)
    with pytest.raises(CheckpointError, match=r"field\.density\.bias holds numbers that are not"):
        load_model(tmp_path / "m.safetensors")


@pytest.mark.parametrize("kind", [torch.int64, torch.complex64, torch.bool])
def test_weights_of_another_type_are_refused(tmp_path: Path, kind: torch.dtype) -> None:
    save_model(tmp_path / "m.safetensors", presets.build(small_config()))
    tensors, header = read_tensors(tmp_path / "m.safetensors")
    tensors["field.density.bias"] = torch.zeros(1, dtype=kind)
    write_tensors(tmp_path / "m.safetensors", tensors, header)
    with pytest.raises(CheckpointError, match="is of another type"):
        load_model(tmp_path / "m.safetensors")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("reference.images", torch.zeros(2, 3)),
        ("reference.c2w", torch.zeros(9, 3, 4)),
        ("reference.centres", torch.full((2, 2), torch.nan)),
        ("reference.more", torch.zeros(1)),
        ("mouth.images", torch.zeros(6, 4, 4, 3)),
        ("mouth.lips", torch.zeros(5, 40, 2)),
        ("mouth.reading", torch.full((11, 80), torch.nan)),
        ("mouth.more", torch.zeros(1)),
        ("focal", "long"),
        ("focal", float("inf")),
        ("scale", -1.0),
        ("scale", [1]),
    ],
)
def test_odd_references_are_refused(tmp_path: Path, name: str, value: object) -> None:
    path = tmp_path / "p.safetensors"
    model = presets.build(small_config())
    views = FastMethod(model).reference_views(person(), torch.tensor([1, 4]))
    save_person(path, model, views, {})
    tensors, header = read_tensors(path)
    if isinstance(value, torch.Tensor):
        tensors[name] = value
    else:
        header[name] = value
    write_tensors(path, tensors, header)
    with pytest.raises(CheckpointError, match=r"p\.safetensors: .*fine-tune the person again"):
        load_person(path)


def test_a_full_disk_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", refused)
    with pytest.raises(OSError, match="No space left"):
        write_tensors(tmp_path / "a.safetensors", {"a": torch.zeros(1)}, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("part", ["header", "tensors"])
def test_a_damaged_state_is_seen(tmp_path: Path, part: str) -> None:
    save_state(tmp_path, {"a": torch.arange(64.0)}, {"step": 4711, "sizes": (1, 2)})
    assert not state_is_damaged(tmp_path)
    found = load_state(tmp_path, {"sizes": [1, 2]})
    assert found is not None
    assert found[1] == {"step": 4711, "sizes": [1, 2]}
    path = tmp_path / STATE_FILE
    content = bytearray(path.read_bytes())
    content[content.find(b"4711") if part == "header" else -9] ^= 1
    path.write_bytes(content)
    assert state_is_damaged(tmp_path)
    with pytest.raises(CheckpointError, match="damaged"):
        load_state(tmp_path, {})
    assert not state_is_damaged(tmp_path / "nowhere")
