"""The blocks of docs/development/researchers.md run, with a tiny person in place of the demo's."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

import dfrf
from dfrf import presets
from dfrf.config import MarchConfig
from dfrf.data.reference_cuts import cut_references
from dfrf.fast.fast_model import FastModel
from dfrf.saved_models import save_person
from tests import clips, fakes
from tests.dfrf.people import person, small_config

pytestmark = pytest.mark.medium


PAGE = Path(__file__).parents[2] / "docs" / "development" / "researchers.md"
BLOCKS = [
    part.split("```")[0] for part in PAGE.read_text(encoding="utf-8").split("```python\n")[1:]
]
SPEECH = 80  # features of mel


def lines_of(block: str) -> list[str]:
    rows = (line for line in block.splitlines() if line.strip())
    return [line for line in rows if not line.startswith(("from ", "import "))]


def test_the_blocks_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    demo = tmp_path / "out" / "demo"
    folder = demo / "work" / "identities" / "alba"
    for made in (demo / "source", folder / "finetune", folder / "prepare"):
        made.mkdir(parents=True)
    clips.write_sound(demo / "source" / "italian.wav", 1.2)
    clip = clips.write_clip(demo / "source" / "clip.mp4", 25)
    prepared = fakes.write_prepared(clip, folder / "prepare", size=48)
    sizes = small_config(speech_dim=SPEECH)
    views = cut_references(person(), torch.tensor([0, 5]))
    save_person(
        folder / "finetune" / "model.safetensors", presets.build(sizes), views, {"speech": "mel"}
    )
    small = presets.Preset(sizes.field, presets.FAST_TRAININGS)
    monkeypatch.setitem(presets.PRESETS, "fast", small)
    monkeypatch.setattr(presets, "MarchConfig", lambda: MarchConfig(resolution=24, step=0.1))
    monkeypatch.chdir(tmp_path)
    assert len(lines_of(BLOCKS[0])) <= 12
    names: dict[str, Any] = {}
    for block in BLOCKS:
        exec(block, names)
    pictures = sorted(tmp_path.glob("*.png"))
    assert len(pictures) == 25
    first = np.asarray(Image.open(pictures[0]))
    assert first.shape == (prepared.size, prepared.size, 3)
    assert (first[0, 0] == 255).all()  # white beside the head
    assert names["picture"].shape == (48, 48, 3)
    assert names["opacity"].mean() > 0.01
    again = dfrf.load_head(tmp_path / "again.safetensors", "cpu")
    assert isinstance(again.method.model, FastModel)
    assert again.views is not None
