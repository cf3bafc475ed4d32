"""The ten lines of docs/researchers.md run, and the door opens without torch."""

import subprocess
import sys
from pathlib import Path

import pytest
import torch

import dfrf
from dfrf import presets
from dfrf.config import MarchConfig
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.model import FastModel
from dfrf.head_checkpoint import save_person
from tests.dfrf.people import SIZE, person, random_model, small_config

PAGE = Path(__file__).parents[2] / "docs" / "researchers.md"


def test_the_lines_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dataset, (model, _) = person(), random_model()
    views = cut_references(dataset, torch.tensor([0, 5]))
    save_person(tmp_path / "model.safetensors", model, views, {})
    small = presets.Preset(small_config().field, presets.FAST_TRAININGS)
    monkeypatch.setitem(presets.PRESETS, "fast", small)
    monkeypatch.setattr(presets, "MarchConfig", lambda: MarchConfig(resolution=24, step=0.1))
    monkeypatch.chdir(tmp_path)
    code = PAGE.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    assert len([line for line in code.splitlines() if line and "import" not in line]) < 11
    names = {"dataset": dataset}
    exec(code, names)
    picture, opacity = names["picture"], names["opacity"]
    assert isinstance(picture, torch.Tensor)
    assert isinstance(opacity, torch.Tensor)
    assert picture.shape == (SIZE, SIZE, 3)
    assert 0.05 < opacity.mean() < 0.95
    torch.testing.assert_close(picture[0, 0], torch.ones(3))  # background beside the head
    again = dfrf.load_head(tmp_path / "again.safetensors", "cpu")
    assert isinstance(again.method.model, FastModel)
    assert again.views is not None
    before = model.state_dict()
    assert any(not v.equal(before[n]) for n, v in again.method.model.state_dict().items())


def test_a_frame_follows_the_expression() -> None:
    dataset, (model, _) = person(), random_model()
    head = dfrf.Head.of(model, cut_references(dataset, torch.tensor([0, 5])))
    camera = dfrf.Camera(dataset.c2w[2], dataset.focal, dataset.centres[2], SIZE)
    calm, _ = dfrf.render_frame(head, camera)
    raised = torch.zeros(1, 6)
    raised[:, 2:4] = 3.0
    moved, _ = dfrf.render_frame(head, camera, expression=raised)
    again, _ = dfrf.render_frame(head, camera, expression=torch.zeros(1, 6))
    assert torch.equal(calm, again)
    assert (moved - calm).abs().max() > 0.01


def test_the_door_opens_without_torch() -> None:
    code = "import sys, dfrf; dir(dfrf); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
    with pytest.raises(AttributeError, match="nothing"):
        _ = dfrf.nothing
    assert all(hasattr(dfrf, name) for name in dfrf.__all__)
