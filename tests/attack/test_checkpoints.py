"""Model files whose headers, sizes and numbers are not what they should be."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from dfrf import presets
from dfrf.checkpoint import read_tensors
from dfrf.saved_models import save_model
from dubbing.heads import initial_model
from dubbing.stages.finetune import Finetune
from tests.attack import rule
from tests.attack.conftest import Room
from tests.attack.odd import cases, damaged, names, numbers, spoilt
from tests.attack.test_manifests import WHOLE
from tests.attack.test_media import pieces
from tests.dfrf.people import small_config

pytestmark = pytest.mark.medium


ODD_FLOATS = (float("nan"), float("inf"), 1e38, -1e38, 0.0)
DTYPES = ("F32", "F16", "BF16", "F64", "I64", "U8", "BOOL", "F8_E4M3", "X9")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small model in our format."""
    path = tmp_path_factory.mktemp("model") / "model.safetensors"
    torch.manual_seed(0)
    save_model(path, presets.build(small_config(speech_dim=80)), {"speech": "mel"})
    return path


@pytest.fixture
def loading(stand_ins: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fine-tune loads the base that it is given, and learns nothing."""
    learnt = Finetune.run

    def load(self: Finetune, out: Path, progress: Any) -> None:
        initial_model.init_from_base(self.base, self.settings)
        learnt(self, out, progress)

    config = small_config(speech_dim=80)
    monkeypatch.setattr(presets, "model_config", lambda *_: config)
    monkeypatch.setattr(Finetune, "run", load)


def parts(path: Path) -> tuple[dict[str, Any], dict[str, Any], bytes]:
    """The table of tensors, our header, and the numbers of a safetensors file."""
    content = path.read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    table = json.loads(content[8 : 8 + length])
    return table, json.loads(table["__metadata__"]["dfrf"]), content[8 + length :]


def put_together(table: Any, header: Any, content: bytes, length: int | None = None) -> bytes:
    if header is not None and isinstance(table, dict):
        text = header if isinstance(header, str) else json.dumps(header)
        table = {**table, "__metadata__": {"dfrf": text}}
    head = json.dumps(table).encode(errors="surrogatepass")
    return struct.pack("<Q", len(head) if length is None else length) + head + content


@st.composite
def checkpoints(draw: st.DrawFn, path: Path) -> bytes:
    table, header, content = parts(path)
    act = draw(st.sampled_from(("header", "header", "table", "tensor", "numbers", "bytes", "size")))
    if act == "header":
        return put_together(table, draw(spoilt(header) | names), content)
    if act == "table":
        return put_together(draw(spoilt(table, 2)), None, content)
    if act == "tensor":
        name = draw(st.sampled_from(sorted(set(table) - {"__metadata__"})))
        changed = {
            "dtype": draw(st.sampled_from(DTYPES)),
            "shape": draw(st.lists(st.integers(0, 9) | numbers, max_size=4)),
        }
        key = draw(st.sampled_from(sorted(changed)))
        table[name] = {**table[name], key: changed[key]}
        return put_together(table, header, content)
    if act == "numbers":
        count = len(content) // 4
        value = struct.pack("<f", draw(st.sampled_from(ODD_FLOATS)))
        at = 4 * draw(st.integers(0, count - 1))
        many = draw(st.sampled_from((1, 100, count)))
        content = content[:at] + (value * many)[: len(content) - at] + content[at + 4 * many :]
        return put_together(table, header, content)
    if act == "size":
        length = draw(st.sampled_from((0, 1, 2**31, 2**63, 2**64 - 1)) | st.integers(0, 2**64 - 1))
        return put_together(table, header, content, length)
    return draw(damaged(path.read_bytes()) | pieces)


@given(st.data())
@cases(25)
def test_plans_with_odd_bases(room: Room, model: Path, data: st.DataObject) -> None:
    with room() as folder:
        (folder / "base.safetensors").write_bytes(data.draw(checkpoints(model)))
        path = with_base(folder, data.draw(st.sampled_from(("fast", "paper"))))
        rule.judge("checkpoint: plan", folder, "plan", path, reads_only=True)


@pytest.mark.usefixtures("loading")
@given(st.data())
@cases(3)
def test_dubs_from_odd_bases(room: Room, model: Path, data: st.DataObject) -> None:
    with room() as folder:
        (folder / "base.safetensors").write_bytes(data.draw(checkpoints(model)))
        rule.judge("checkpoint: dub", folder, "dub", with_base(folder, "fast"))


@given(st.data())
@cases(20)
def test_imports_of_odd_files(room: Room, model: Path, data: st.DataObject) -> None:
    with room() as folder:
        (folder / "x.tar").write_bytes(data.draw(checkpoints(model)))
        out = data.draw(st.sampled_from(("out/m.safetensors", "out", "out/x/y", "x.tar")))
        rule.judge("checkpoint: import", folder, "import-checkpoint", "x.tar", out)


def test_a_base_that_holds_is_loaded(room: Room, model: Path, loading: None) -> None:
    """So that the cases above are refused for what was done to them."""
    assert read_tensors(model)[1]["speech"] == "mel"
    with room() as folder:
        (folder / "base.safetensors").write_bytes(put_together(*parts(model)))
        ending = rule.call("dub", with_base(folder, "fast"))
        assert ending.code == 0, ending.out


def with_base(folder: Path, preset: str) -> Path:
    """A manifest whose person starts from `base.safetensors`."""
    data = json.loads(json.dumps(WHOLE))
    data["identities"]["ann"] |= {"base": "base.safetensors", "speech": "mel", "preset": preset}
    path = folder / "m.yaml"
    path.write_text(json.dumps(data))
    return path
