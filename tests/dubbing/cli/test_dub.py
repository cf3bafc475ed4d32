"""The commands `dub` and `plan`, and their exit codes."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from dubbing import media
from dubbing.stages.finetune import Finetune

pytestmark = pytest.mark.medium


def test_dub_then_plan(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = dfrf("dub", manifest)
    assert code == 0, err
    assert "it: sync pass" in out
    assert "report.html" in out
    code, out, _ = dfrf("plan", "--json", manifest)
    assert code == 0
    assert {row["state"] for row in json.loads(out)["stages"]} == {"up to date"}
    code, out, _ = dfrf("plan", manifest)
    assert "0 to run, 8 up to date" in out


def test_a_manifest_without_dubs_is_2_before_anybody_is_learned(  # type: ignore[no-untyped-def]
    dfrf, manifest: Path
) -> None:
    text = manifest.read_text()
    for without in ("dubs: []", "dubs:", ""):
        manifest.write_text(text[: text.index("dubs:")] + without)
        code, _, err = dfrf("dub", manifest)
        assert code == 2
        assert "the manifest has no dubs, so nothing would be made" in err
        code, out, _ = dfrf("plan", "--json", manifest)
        assert code == 0
        assert any("has no dubs" in warning for warning in json.loads(out)["warnings"])
    assert not (manifest.parent / "out").exists()


def test_a_gpu_that_is_not_there_is_2(  # type: ignore[no-untyped-def]
    dfrf, manifest: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    code, _, err = dfrf("dub", manifest, "--device", "cuda")
    assert code == 2
    assert "torch sees no GPU here (--device cuda): use auto or cpu" in err
    assert not (manifest.parent / "out").exists()


def test_a_wrong_manifest_is_2_and_reports_everything(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    manifest.write_text(manifest.read_text().replace("version: 1", "version: 3\nlabel: x"))
    code, _, err = dfrf("dub", manifest)
    assert code == 2
    assert "2 problems" in err
    assert "line 2: version: must be 1" in err
    assert "line 3: label: unknown key" in err


@pytest.mark.parametrize("output", ["/proc/out", "/dev/full/out"])
def test_an_output_that_cannot_be_written_is_found_by_plan(
    dfrf: Any, manifest: Path, output: str
) -> None:
    if not Path(output).parent.exists():
        pytest.skip("no such file system here")
    manifest.write_text(manifest.read_text().replace("output: out", f"output: {output}"))
    for command in ("plan", "dub"):
        code, _, err = dfrf(command, manifest)
        assert code == 2
        assert "line 3: output: " in err


def test_a_failed_job_is_1(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    manifest.write_text(manifest.read_text().replace("ann.mp4", "noface.mp4"))
    code, out, _ = dfrf("dub", manifest)
    assert code == 1
    assert "no face found (noface.mp4): film the face" in out


def test_a_sync_check_that_falls_short_is_3(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    manifest.write_text(manifest.read_text().replace("name: it", "name: fellshort"))
    assert dfrf("dub", manifest)[0] == 3


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_is_130_and_goes_on_later(  # type: ignore[no-untyped-def]
    dfrf,
    manifest: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
    number: int,
) -> None:

    finetune = Finetune.run
    # Whoever starts the tests in the background has SIGINT ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))

    def interrupted(*_arguments: object) -> None:
        os.kill(os.getpid(), number)
        time.sleep(60)
        raise AssertionError("the signal did not interrupt the run")

    monkeypatch.setattr(Finetune, "run", interrupted)
    code, _, err = dfrf("dub", manifest)
    assert code == 130
    assert "run the same command again" in err
    monkeypatch.setattr(Finetune, "run", finetune)
    assert dfrf("dub", manifest)[0] == 0


def test_a_film_and_a_recording_need_no_manifest(dfrf: Any, footage: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "ann_it.mp4"
    call: tuple[object, ...] = ("dub", footage / "ann.mp4", footage / "it.wav", "-o", out)
    call += ("--consent", "Ann Smith, form 17")
    code, _, err = dfrf(*call, "--preview", 0.5)
    assert code == 0, err
    first = out.with_name("ann_it.preview.mp4")
    assert media.probe(first).frames == 13
    assert not out.exists()
    work = out.parent / "work" / "identities"
    learned = {p: p.stat().st_mtime_ns for p in work.rglob("stage.json")}
    code, _, err = dfrf(*call)
    assert code == 0, err
    assert media.probe(out).frames == 40
    assert {p: p.stat().st_mtime_ns for p in work.rglob("stage.json")} == learned
    assert dfrf("plan", out.with_suffix(".yaml"))[0] == 0
    record = json.loads((out.parent / "report.json").read_text())
    assert record["identities"]["ann"]["consent"]["reference"] == "form 17"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--preview", 3), "goes with CLIP SPEECH alone (--preview): write it into the manifest"),
        (("-o", "x.mp4"), "goes with CLIP SPEECH alone (--output)"),
        (("it.wav",), "where is the dub to go? (--output): as -o OUT.mp4"),
        (("it.wav", "-o", "x.mp4", "--only", "x"), "there is one dub alone (--only)"),
        (("it.wav", "-o", "x.mp4", "--preview", 0), "0 s is no length (--preview)"),
        (("it.wav", "-o", "x.mp4"), "no such file (it.wav)"),
    ],
)
def test_a_short_call_that_cannot_be_meant_is_2(
    dfrf: Any, manifest: Path, words: tuple[object, ...], said: str
) -> None:
    code, _, err = dfrf("dub", manifest, *words)
    assert code == 2
    assert said in err
