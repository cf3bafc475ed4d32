"""Runs that were killed, that damage files, or that meet one another."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubbing.batch.jobs import build
from dubbing.engine.environment import of_children, python
from dubbing.engine.planning import planner as planning
from dubbing.manifest.manifest import load
from tests.dubbing.batches import ROOT, dub, manifest_of

pytestmark = [pytest.mark.medium, pytest.mark.usefixtures("stand_ins")]


def tree(folder: Path) -> dict[str, str]:
    """Digest of every result below a folder; records hold seconds, so they are left out."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("stage.json", "report.json", "report.html")
    }


def in_a_process(path: Path, kill: str = "") -> int:
    environment = {**of_children(), "DFRF_TEST_KILL": kill}
    command = [*python("tests.fakes"), "dub", str(path)]
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    return done.returncode


def test_kill_at_any_moment_then_run_again(footage: Path, tmp_path: Path) -> None:
    """After kill -9 and a rerun every file is the same, bit for bit, as undisturbed."""
    whole = tmp_path / "whole"
    whole.mkdir()
    assert in_a_process(manifest_of(footage, whole, {"ann": "ann.mp4"})) == 0
    undisturbed = tree(whole / "out")
    assert "ann_it.mp4" in undisturbed
    killed = tmp_path / "killed"
    killed.mkdir()
    path = manifest_of(footage, killed, {"ann": "ann.mp4"})
    # One run after another, each killed a little later, in one and the same folder.
    for kill in ("prepare:2", "finetune:3", "refine_poses:1", "render:4", "composite:17", "mux:1"):
        assert in_a_process(path, kill) == -signal.SIGKILL, kill
        assert not (killed / "out" / "ann_it.mp4").exists()
    assert in_a_process(path) == 0
    assert tree(killed / "out") == undisturbed
    # One that was killed between the end of its work and that of its claim.
    code = (
        "import sys, os, pathlib; from dubbing.engine.disk import claims\n"
        "claims.take(pathlib.Path(sys.argv[1])); os.kill(os.getpid(), 9)"
    )
    prepared = killed / "out" / "work" / "identities" / "ann" / "prepare"
    subprocess.run([sys.executable, "-c", code, str(prepared)], cwd=ROOT, check=False)
    assert tree(killed / "out") != undisturbed
    assert in_a_process(path) == 0
    assert tree(killed / "out") == undisturbed


def test_publishing_that_was_killed_leaves_nothing_behind(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    out = tmp_path / "out"
    (out / "ann_it.mp4").rename(out / ".ann_it.4711.tmp.mp4")  # as between link and replace
    for name in (".ann_it.sync.4711.tmp.json", ".report.4711.tmp.json", ".report.4711.tmp.html"):
        (out / name).write_text("half")
    dub(path)
    lists = {f"ann_it.{kind}" for kind in ("edl", "lines.csv", "lines.jsonl")}
    expected = {"ann_it.mp4", "ann_it.sync.json", *lists, "report.html", "report.json", "work"}
    assert {p.name for p in out.iterdir()} == expected


@pytest.mark.parametrize("content", ["[3]", '{"verdict": [], "warnings": 3, "outputs": {"a": []}}'])
def test_damaged_files_of_ours_do_not_end_a_run(
    footage: Path, tmp_path: Path, content: str
) -> None:
    people = {"ann": "ann.mp4", "bob": "bob.mp4"}
    path = manifest_of(footage, tmp_path, people)
    dub(path, only=("ann_it",))
    work = tmp_path / "out" / "work"
    for name in ("check/sync.json", "cues/*/listen/stage.json", "cues/*/listen/speech.json"):
        (file,) = (work / "dubs" / "ann_it").glob(name)
        file.write_text(content)
    for name in ("prepare/prepared.json", "finetune/stage.json"):
        (work / "identities" / "ann" / name).write_text(content)
    (work / "identities" / "ann" / "finetune" / "loss.csv").write_text("step,loss,psnr\n1,x\n")
    planning.rows(build(load(path)))
    result, _ = dub(path, only=("bob_it",))
    assert (result.code, result.outcomes["dub/bob_it"].state) == (0, "made")
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["dubs"]["ann_it"]["sync"] is None
    summary, curve = report["identities"]["ann"]["warnings"]
    assert "prepared clip holds something else" in summary
    assert "loss.csv: is no curve of a training" in curve
    result, _ = dub(path)  # all of it is made again
    assert result.code == 0
