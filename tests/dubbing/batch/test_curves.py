"""Tables of lip curves of a batch: what is in them, and when they are not written."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubbing.batch.curves import write_curves
from dubbing.errors import ExplainedError
from dubbing.face.mouth.lip_curves import LipCurves
from dubbing.manifest.manifest import load
from dubbing.script.edit import Edit
from dubbing.script.timeline import Cue
from dubbing.stages.draft import HalfSize
from tests.dubbing.studio.conftest import made, manifest
from tests.dubbing.studio.stand_in import lips

__all__ = ["made", "manifest"]
pytestmark = pytest.mark.medium


def curves(self: HalfSize, cue: Cue, edit: Edit) -> np.ndarray:
    """Lips that open and close, a quarter closed."""
    return np.c_[(found := lips(self, cue, edit)), np.full(len(found), 0.25)]


@pytest.fixture(autouse=True)
def _lips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(HalfSize, "curves", curves)


def written(path: Path) -> Path:
    (found,) = write_curves(load(path))
    return found


def test_a_row_a_frame_of_every_line(manifest: Path) -> None:
    table = written(manifest)
    assert table == manifest.parent / "out" / "it.curves.csv"
    rows = list(csv.DictReader(table.read_text().splitlines()))
    frames = [*range(5, 20), *range(40, 55)]
    assert [(int(row["line"]), int(row["frame"])) for row in rows] == [
        (1 if k < 30 else 3, k) for k in frames
    ]
    assert [float(row["time (s)"]) for row in rows[15:17]] == pytest.approx([0.02, 0.06])
    found = LipCurves.read(table, 3)
    np.testing.assert_allclose(found.values[:, 0], 0.1 + 0.05 * np.sin(range(15)), atol=1e-4)
    np.testing.assert_allclose(found.values[:, -1], 0.25)


def test_a_table_that_an_edit_reads_is_not_written_over(manifest: Path) -> None:
    table = written(manifest)
    before = table.read_bytes()
    text = manifest.read_text()
    edit = "edits: {line: 1, curves: out/it.curves.csv}"
    manifest.write_text(text.replace("track.wav}", f"track.wav, {edit}}}"))
    with pytest.raises(ExplainedError, match=r"an edit reads this file.*copy it to"):
        written(manifest)
    assert table.read_bytes() == before


def test_a_file_of_somebody_else_stays(manifest: Path) -> None:
    (manifest.parent / "out" / "it.curves.csv").write_text("mine")
    with pytest.raises(ExplainedError, match="was not made by this tool"):
        written(manifest)


def test_a_person_has_to_be_learned(manifest: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def without(*_: Any) -> None:
        return None

    monkeypatch.setattr(HalfSize, "curves", without)
    with pytest.raises(ExplainedError, match="the model of ann has no lip measures"):
        written(manifest)
    for record in (manifest.parent / "out" / "work").rglob("finetune/stage.json"):
        record.unlink()
    with pytest.raises(ExplainedError, match="a person is not learned yet"):
        written(manifest)
