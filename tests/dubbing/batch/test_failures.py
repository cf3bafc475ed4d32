"""A failed job stops what needs it, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubbing import media
from dubbing.batch import batch
from dubbing.engine.graph.graph import Job
from dubbing.engine.graph.stage import Stage
from dubbing.errors import ExplainedError
from dubbing.manifest.manifest import load
from tests.dubbing.batches import Listener, dub, manifest_of

pytestmark = [pytest.mark.medium, pytest.mark.usefixtures("stand_ins")]


@pytest.mark.parametrize("broken", ["noface.mp4", "damaged.mp4"])
def test_one_broken_clip_among_three(footage: Path, tmp_path: Path, broken: str) -> None:
    people = {"ann": "ann.mp4", "bad": broken, "bob": "bob.mp4"}
    path = manifest_of(footage, tmp_path, people)
    result, _ = dub(path)
    out = tmp_path / "out"
    assert result.code == 1
    assert sorted(p.name for p in out.glob("*.mp4")) == ["ann_it.mp4", "bob_it.mp4"]
    report = json.loads((out / "report.json").read_text())
    assert report["identities"]["bad"]["state"] == "failed"
    assert report["dubs"]["bad_it"]["state"] == "skipped"
    assert report["dubs"]["bad_it"]["failure"]["what"].startswith("identity bad failed: ")
    assert report["identities"]["bad"]["failure"]["remedy"]
    page = (out / "report.html").read_text()
    assert "What to do:" in page
    assert broken in page


def test_a_broken_clip_alone(footage: Path, tmp_path: Path) -> None:
    result, began = dub(manifest_of(footage, tmp_path, {"bad": "damaged.mp4"}))
    assert (result.code, began) == (1, [])
    assert result.outcomes["dub/bad_it"].state == "skipped"


def test_fail_fast_stops(footage: Path, tmp_path: Path) -> None:
    people = {"bad": "noface.mp4", "ann": "ann.mp4"}
    path = manifest_of(footage, tmp_path, people)
    result, began = dub(path, keep_going=False)
    assert (result.code, began) == (1, ["bad:prepare"])
    assert result.outcomes["dub/ann_it"].state == "stopped"
    # Without it the rest is made.
    result, began = dub(path)
    assert "ann_it:composite" in began


def test_a_disk_that_is_full_at_the_end(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    people = {"ann": "ann.mp4", "bad": "noface.mp4", "bob": "bob.mp4"}
    path = manifest_of(footage, tmp_path, people)
    out = tmp_path / "out"
    production = load(path)  # which would refuse what comes in the way now
    planned = batch.begin(production)
    (out / "ann_it.mp4").mkdir(parents=True)
    (out / "report.html").mkdir()
    result = batch.dub(production, planned, Listener())
    assert result.code == 1
    failure = result.outcomes["dub/ann_it"].failure
    assert failure is not None
    assert (failure.stage, failure.trace) == ("publish", "")
    assert "a folder lies where a file should go" in str(failure)
    assert (out / "bob_it.mp4").is_file()  # the others go on
    bad = result.outcomes["identity/bad"].failure  # and the job's own failure is still there
    assert bad is not None
    assert bad.what == "no face found"
    assert isinstance(result.report, ExplainedError)
    assert "report.html" in str(result.report)
    (out / "ann_it.mp4").rmdir()
    (out / "report.html").rmdir()
    result, _ = dub(path)
    assert result.outcomes["dub/ann_it"].state == "kept"
    assert (out / "ann_it.mp4").is_file()


@pytest.mark.parametrize("before", ["finetune", "render", "composite"])
def test_a_clip_exchanged_between_stages_fails_its_job(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str
) -> None:
    clip = tmp_path / "own.mp4"
    clip.write_bytes((footage / "ann.mp4").read_bytes())
    manifest = manifest_of(footage, tmp_path, {"ann": str(clip), "bob": "bob.mp4"})

    class Exchange(Listener):
        def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
            super().begin(job, stage, reasons)
            if stage.kind == before and job.name.startswith("ann"):
                clip.write_bytes((footage / "noface.mp4").read_bytes() + b"other")

    result, _ = dub(manifest, listener=Exchange())
    assert result.code == 1
    label = "identity/ann" if before == "finetune" else "dub/ann_it"
    failure = result.outcomes[label].failure
    assert failure is not None
    assert failure.what == "own.mp4 changed while the run was going on"
    assert failure.remedy == "run it again"
    assert not (tmp_path / "out" / "ann_it.mp4").exists()
    assert (tmp_path / "out" / "bob_it.mp4").is_file()


def test_longer_audio_can_fail_its_dub_alone(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", on_longer_audio: fail")
    more = f"  - {{name: short, identity: ann, audio: {footage / 'it.wav'}, audio_seconds: 1}}\n"
    path.write_text(path.read_text() + more)
    result, began = dub(path)
    assert result.code == 1
    failure = result.outcomes["dub/ann_it"].failure
    assert failure is not None
    assert failure.what == "the speech lasts 40 frames, the clip 30 from video_start on"
    assert not any(name.startswith("ann_it") for name in began)
    assert media.count_frames(tmp_path / "out" / "short.mp4") == 25
