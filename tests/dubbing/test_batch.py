from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubbing import batch, media
from dubbing.engine import lock
from dubbing.engine import planner as planning
from dubbing.engine.graph import Job
from dubbing.engine.runner import Failure, Options
from dubbing.engine.stage import Stage
from dubbing.errors import DubbingError, LockedError
from dubbing.manifest.manifest import load
from dubbing.pipeline import build
from tests import clips, fakes

CONSENT = '{by: "the person on film", reference: "form 17"}'
ROOT = Path(__file__).resolve().parents[2]


class Listener:
    """Remembers which stages ran."""

    def __init__(self) -> None:
        self.began: list[str] = []

    def begin(self, job: Job, stage: Stage, reasons: list[str]) -> None:
        self.began.append(f"{job.name}:{stage.name}")

    def progress(self, job: Job, stage: Stage, message: str, share: float) -> None:
        assert 0 <= share <= 1

    def end(self, job: Job, stage: Stage, failure: Failure | None) -> None:
        pass


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("footage")
    clips.write_clip(folder / "ann.mp4", 30)
    clips.write_clip(folder / "bob.mp4", 30)
    clips.write_clip(folder / "noface.mp4", 30)
    clips.write_sound(folder / "it.wav", 1.6)
    whole = (folder / "bob.mp4").read_bytes()
    (folder / "damaged.mp4").write_bytes(whole[: len(whole) // 3])
    return folder


@pytest.fixture(autouse=True)
def _stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    fakes.install(monkeypatch.setattr)


def manifest_of(footage: Path, folder: Path, people: dict[str, str], extra: str = "") -> Path:
    lines = ["version: 1", "output: out", "identities:"]
    lines += [
        f"  {name}: {{clip: {footage / clip}, seconds: 1, consent: {CONSENT}}}"
        for name, clip in people.items()
    ]
    lines += ["dubs:"]
    lines += [f"  - {{identity: {name}, audio: {footage / 'it.wav'}{extra}}}" for name in people]
    path = folder / "m.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def dub(path: Path, **options: object) -> tuple[batch.Result, list[str]]:
    listener = Listener()
    only = options.pop("only", ())
    result = batch.dub(load(path), listener, Options(**options), only=only)  # type: ignore[arg-type]
    return result, listener.began


def test_a_dub_from_end_to_end(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    result, began = dub(path)
    assert result.code == 0
    expected = (
        "ann:prepare ann:check_source ann:finetune ann:refine_poses "
        "ann_it:listen ann_it:render ann_it:composite ann_it:check"
    )
    assert began == expected.split()
    out = tmp_path / "out"
    info = media.probe(out / "ann_it.mp4")
    # 1.6 s at 25 are 40 frames; the clip has 30, so the poses bounce.
    assert media.count_frames(out / "ann_it.mp4") == 40
    assert info.audio_rate == 48000
    shown = [clips.number(frame) for frame in media.read_frames(out / "ann_it.mp4")]
    assert shown == [*range(30), *range(28, 18, -1)]
    assert json.loads((out / "ann_it.sync.json").read_text())["verdict"] == "pass"
    report = json.loads((out / "report.json").read_text())
    assert report["dubs"]["ann_it"]["state"] == "made"
    assert report["identities"]["ann"]["consent"]["reference"] == "form 17"
    assert report["identities"]["ann"]["loss"] == [0.5, 0.25]
    page = (out / "report.html").read_text()
    assert "<h1>1 dub: 1 passed, 0 warned, 0 failed</h1>" in page
    assert 'controls playsinline preload="none"\nsrc="ann_it.mp4"' in page
    assert report["dubs"]["ann_it"]["verdict"] == "passed"
    source = out / report["dubs"]["ann_it"]["source"]  # it is shown from where it lies
    assert source.samefile(footage / "ann.mp4")
    assert "polyline" in page


def test_a_second_run_has_nothing_to_do(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    before = (tmp_path / "out" / "ann_it.mp4").stat().st_mtime_ns
    result, began = dub(path)
    assert (result.code, began) == (0, [])
    assert result.outcomes["dub/ann_it"].state == "kept"
    assert (tmp_path / "out" / "ann_it.mp4").stat().st_mtime_ns == before


def test_only_what_depends_on_a_change_is_made_again(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    path.write_text(path.read_text().replace("it.wav}", "it.wav, label: false}"))
    _, began = dub(path)
    assert began == ["ann_it:composite", "ann_it:check"]
    path.write_text(path.read_text().replace("seconds: 1,", "seconds: 1, seed: 3,"))
    _, began = dub(path)
    # The stand-in heads do not depend on the seed, so nothing follows from them.
    assert began == ["ann:finetune", "ann:refine_poses", "ann_it:render"]


def test_a_folder_that_was_moved_is_up_to_date(footage: Path, tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    for name in ("ann.mp4", "it.wav"):
        (before / name).write_bytes((footage / name).read_bytes())
    path = manifest_of(before, before, {"ann": "ann.mp4"})
    dub(path)
    before.rename(after)
    moved = after / path.name
    moved.write_text(moved.read_text().replace(str(before), str(after)))
    assert dub(moved)[1] == []
    assert dub(moved, force=("render",))[1] == ["ann_it:render"]  # it reads the clip where it is


def test_a_dub_that_was_renamed_is_up_to_date(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", name: before")
    dub(path)
    path.write_text(path.read_text().replace("name: before", "name: other"))
    assert {row.state for row in planning.rows(build(load(path)))} == {"up to date"}
    assert (tmp_path / "out" / "work" / "dubs" / "before").is_dir()  # a plan moves nothing
    assert dub(path)[1] == []
    assert (tmp_path / "out" / "other.mp4").is_file()
    assert [p.name for p in (tmp_path / "out" / "work" / "dubs").iterdir()] == ["other"]


def test_the_report_shows_the_codec_that_was_asked_for(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    path.write_text(path.read_text().replace("it.wav}", "it.wav, codec: ffv1}"))
    dub(path)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["dubs"]["ann_it"]["video"] == "ann_it.mkv"
    assert (tmp_path / "out" / "ann_it.mp4").is_file()  # whoever put it there may want it


def test_a_lost_result_is_put_back(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    (tmp_path / "out" / "ann_it.mp4").unlink()
    _, began = dub(path)
    assert began == []
    assert (tmp_path / "out" / "ann_it.mp4").is_file()


def test_consent_is_in_the_record_of_a_dub(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    record = tmp_path / "out" / "work" / "dubs" / "ann_it" / "video" / "stage.json"
    dub(path)
    consent = json.loads(record.read_text())["parameters"]["consent"]
    assert consent == {"by": "the person on film", "date": None, "reference": "form 17"}
    path.write_text(path.read_text().replace("form 17", "form 18"))
    _, began = dub(path)
    assert began == ["ann_it:composite"]
    assert json.loads(record.read_text())["parameters"]["consent"]["reference"] == "form 18"


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


def test_fail_fast_stops(footage: Path, tmp_path: Path) -> None:
    people = {"bad": "noface.mp4", "ann": "ann.mp4"}
    path = manifest_of(footage, tmp_path, people)
    result, began = dub(path, keep_going=False)
    assert (result.code, began) == (1, ["bad:prepare"])
    assert result.outcomes["dub/ann_it"].state == "stopped"
    # Without it the rest is made.
    result, began = dub(path)
    assert "ann_it:composite" in began


def test_a_sync_check_that_falls_short(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", name: fellshort")
    result, _ = dub(path)
    assert result.code == 3
    assert (tmp_path / "out" / "fellshort.mp4").is_file()


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


def test_cut_ends_with_the_clip(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"}, ", on_longer_audio: cut")
    dub(path)
    assert media.count_frames(tmp_path / "out" / "ann_it.mp4") == 30


def test_only(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4", "bob": "bob.mp4"})
    result, began = dub(path, only=("bob_it",))
    assert {name.split(":")[0] for name in began} == {"bob", "bob_it"}
    assert result.code == 0
    told = json.loads((tmp_path / "out" / "report.json").read_text())
    assert told["dubs"]["ann_it"]["state"] == "not in this run"
    with pytest.raises(DubbingError, match="nothing is called nobody"):
        dub(path, only=("nobody",))


def test_force(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    _, began = dub(path, force=("listen",))
    assert began == ["ann_it:listen"]  # it came out the same, so nothing follows


def test_a_locked_folder_is_left_alone(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    with lock.hold(tmp_path / "out" / "work"), pytest.raises(LockedError):
        dub(path)


def test_plan_says_what_would_run_and_why(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4", "bad": "damaged.mp4"})

    def states(force: tuple[str, ...] = ()) -> dict[str, str]:
        found = planning.rows(build(load(path)), force)
        return {f"{row.job.name}:{row.stage}": f"{row.state}; {row.reasons}" for row in found}

    first = states()
    assert first["ann:prepare"].startswith("run; ('not made yet',)")
    assert first["bad_it:all"].startswith("blocked")
    assert not (tmp_path / "out").exists()  # it wrote nothing
    dub(path)
    assert set(states().values()) >= {"up to date; ()"}
    path.write_text(path.read_text().replace("seconds: 1,", "seconds: 1, seed: 3,", 1))
    changed = states()
    assert changed["ann:prepare"] == "up to date; ()"
    assert changed["ann:finetune"] == "run; ('seed: 0 before, 3 now',)"
    assert changed["ann_it:render"].startswith("after; ('if finetune or refine_poses gives another")
    assert changed["ann_it:composite"].startswith("after")
    assert changed["ann_it:listen"] == "up to date; ()"
    assert states(("listen",))["ann_it:listen"] == "run; ('forced',)"


def tree(folder: Path) -> dict[str, str]:
    """Digest of every result below a folder; records hold seconds, so they are left out."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("stage.json", ".lock", "report.json", "report.html")
    }


def in_a_process(path: Path, kill: str = "") -> int:
    environment = {**os.environ, "DFRF_TEST_KILL": kill}
    command = [sys.executable, "-m", "tests.fakes", "dub", str(path)]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, check=False)
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
            if stage.name == before and job.name.startswith("ann"):
                clip.write_bytes((footage / "noface.mp4").read_bytes() + b"other")

    result = batch.dub(load(manifest), Exchange(), Options())
    assert result.code == 1
    label = "identity/ann" if before == "finetune" else "dub/ann_it"
    failure = result.outcomes[label].failure
    assert failure is not None
    assert failure.what == "own.mp4 changed while the run was going on"
    assert failure.remedy == "run it again"
    assert not (tmp_path / "out" / "ann_it.mp4").exists()
    assert (tmp_path / "out" / "bob_it.mp4").is_file()


def test_a_disk_that_is_full_at_the_end(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    people = {"ann": "ann.mp4", "bad": "noface.mp4", "bob": "bob.mp4"}
    path = manifest_of(footage, tmp_path, people)
    out = tmp_path / "out"
    manifest = load(path)  # which would refuse what comes in the way now
    (out / "ann_it.mp4").mkdir(parents=True)
    (out / "report.html").mkdir()
    result = batch.dub(manifest, Listener())
    assert result.code == 1
    failure = result.outcomes["dub/ann_it"].failure
    assert failure is not None
    assert (failure.stage, failure.trace) == ("publish", "")
    assert "a folder lies where a file should go" in str(failure)
    assert (out / "bob_it.mp4").is_file()  # the others go on
    bad = result.outcomes["identity/bad"].failure  # and the job's own failure is still there
    assert bad is not None
    assert bad.what == "no face found"
    assert isinstance(result.report, DubbingError)
    assert "report.html" in str(result.report)
    (out / "ann_it.mp4").rmdir()
    (out / "report.html").rmdir()
    result, _ = dub(path)
    assert result.outcomes["dub/ann_it"].state == "kept"
    assert (out / "ann_it.mp4").is_file()


def test_publishing_that_was_killed_leaves_nothing_behind(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    dub(path)
    out = tmp_path / "out"
    (out / "ann_it.mp4").rename(out / ".ann_it.4711.tmp.mp4")  # as between link and replace
    for name in (".ann_it.sync.4711.tmp.json", ".report.4711.tmp.json", ".report.4711.tmp.html"):
        (out / name).write_text("half")
    dub(path)
    expected = ["ann_it.mp4", "ann_it.sync.json", "report.html", "report.json", "work"]
    assert sorted(p.name for p in out.iterdir()) == expected


@pytest.mark.parametrize("content", ["[3]", '{"verdict": [], "warnings": 3, "outputs": {"a": []}}'])
def test_damaged_files_of_ours_do_not_end_a_run(
    footage: Path, tmp_path: Path, content: str
) -> None:
    people = {"ann": "ann.mp4", "bob": "bob.mp4"}
    path = manifest_of(footage, tmp_path, people)
    dub(path, only=("ann_it",))
    work = tmp_path / "out" / "work"
    for name in ("check/sync.json", "speech/stage.json", "speech/speech.json"):
        (work / "dubs" / "ann_it" / name).write_text(content)
    for name in ("prepared/prepared.json", "model/stage.json"):
        (work / "identities" / "ann" / name).write_text(content)
    (work / "identities" / "ann" / "model" / "loss.csv").write_text("step,loss,psnr\n1,x\n")
    planning.rows(build(load(path)))
    result, _ = dub(path, only=("bob_it",))
    assert (result.code, result.outcomes["dub/bob_it"].state) == (0, "made")
    told = json.loads((tmp_path / "out" / "report.json").read_text())
    assert told["dubs"]["ann_it"]["sync"] is None
    summary, curve = told["identities"]["ann"]["warnings"]
    assert "prepared clip holds something else" in summary
    assert "loss.csv: is no curve of a training" in curve
    result, _ = dub(path)  # all of it is made again
    assert result.code == 0


def test_controls_and_markup_do_not_reach_the_page(footage: Path, tmp_path: Path) -> None:
    path = manifest_of(footage, tmp_path, {"ann": "ann.mp4"})
    path.write_text(path.read_text().replace("form 17", r"form <b> \e[31m\u202e"))
    dub(path)
    page = (tmp_path / "out" / "report.html").read_text()
    assert r"form &lt;b&gt; \x1b[31m\u202e" in page
    assert "\x1b" not in page
