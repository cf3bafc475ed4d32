"""How much of each line is dubbed: in `plan` before and after, in the files, and in the report."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from scipy.spatial.transform import Rotation

from dubbing.preparation.prepared import PreparedClip
from dubbing.stages.prepare import Prepare
from tests import fakes
from tests.dubbing.batches import dub, manifest_of

pytestmark = pytest.mark.medium

PLAN = """
import sys
from dubbing.cli.main import app
try: app(["plan", *sys.argv[1:]])
except SystemExit as end: assert not end.code
assert "torch" not in sys.modules
"""


def planned(path: Path, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PLAN, *arguments, str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def reach(path: Path) -> Any:
    return json.loads(planned(path, "--json"))["reach"]


@pytest.fixture
def manifest(stand_ins: None, footage: Path, tmp_path: Path, monkeypatch: Any) -> Path:
    """Its film of 30 frames shows no face in two, and something over it in another."""

    def prepare(self: Prepare, out: Path, progress: Any) -> None:
        clip = fakes.write_prepared(self.clip, out, invalid=(3, 4))
        clip.covered[10] = True
        PreparedClip.save(clip)

    monkeypatch.setattr(Prepare, "run", prepare)
    return manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", name: it, mark: false")


def test_a_line_says_how_much_of_it_is_dubbed(manifest: Path) -> None:
    assert reach(manifest) == {}  # nothing is prepared
    assert "it, line" not in planned(manifest)
    result, _ = dub(manifest)
    assert result.code == 0, result.outcomes
    out = manifest.parent / "out"

    # The dub is longer than the film, which runs backwards at its end: frame 30 is frame 28.
    (row,) = csv.DictReader((out / "it.lines.csv").read_text().splitlines())
    assert (row["dubbed"], row["yaw"], row["pitch"]) == ("0.925", "0 degrees", "0 degrees")
    assert row["reasons"] == "no face in 2 frames, covered in 1"
    listed = json.loads((out / "it.lines.jsonl").read_text())
    assert listed["dubbed"] == 0.925
    sentence = (
        "92 % of the frames dubbed, head turned 0 degrees, tilted 0 degrees; "
        "8 % not: no face in 2 frames, covered in 1"
    )
    assert sentence in (out / "report.html").read_text()
    (made,) = reach(manifest)["it"]
    assert made == {key: listed[key] for key in ("line", "in", *made.keys() & listed.keys())} | {
        "reach": sentence,
        "short": True,
    }

    # Before it is made again `plan` reads the prepared film, and the record no more.
    manifest.write_text(manifest.read_text().replace("mark: false", "mark: false, label: false"))
    (out / "work" / "dubs" / "it" / "composite" / "picture.json").unlink()
    shown = planned(manifest)
    assert f"it, line 1 at {listed['in']}: {sentence.replace('dubbed', 'can be dubbed')}" in shown
    prepared = out / "work" / "identities" / "ann" / "prepare" / "track.npz"
    prepared.write_bytes(b"")
    assert reach(manifest) == {}


def test_what_is_turned_too_far_is_known_of_a_learned_person(
    manifest: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def prepare(self: Prepare, out: Path, progress: Any) -> None:
        clip = fakes.write_prepared(self.clip, out)
        clip.rotation[27:] = Rotation.from_euler("y", -80, degrees=True).as_matrix()
        clip.save()

    monkeypatch.setattr(Prepare, "run", prepare)
    result, _ = dub(manifest)
    assert result.code == 0, result.outcomes
    (made,) = reach(manifest)["it"]
    manifest.write_text(manifest.read_text().replace("mark: false", "mark: false, label: false"))
    (line,) = reach(manifest)["it"]
    # 27 to 29, and 28 and 27 again, as the film runs backwards.
    assert made["reasons"] == line["reasons"] == "turned in 5 frames"
    manifest.write_text(manifest.read_text().replace("seconds: 1", "seconds: 1.1"))
    (line,) = reach(manifest)["it"]  # is learned anew
    assert line["reasons"] == ""
    assert line["yaw"] == "0 to 80 degrees right"
