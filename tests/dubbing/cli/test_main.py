from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from dubbing.cli import main as cli
from dubbing.engine.graph.stage import Stage
from dubbing.stages.check import Check
from dubbing.stages.check_source import CheckSource
from dubbing.sync.curves import OFFSETS, Estimate
from dubbing.sync.judgement import Measurement, conclude, film_face
from dubbing.sync.records import SYNC_FILE
from dubbing.sync.result import FaceResult, Figures, Media, SyncResult
from tests import clips

pytestmark = pytest.mark.medium


COMMANDS = (
    "dub",
    "plan",
    "init",
    "prepare",
    "sync",
    "evaluate",
    "train-base",
    "train-speech",
    "train-sync",
    "doctor",
)


def test_help_and_plan_load_nothing_heavy(manifest: Path) -> None:
    code = (
        "import sys; from dubbing.cli.main import app\n"
        "try: app(sys.argv[1:])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert not {'torch', 'scipy', 'cv2', 'soundfile'} & set(sys.modules)"
    )
    for arguments in (["--help"], ["dub", "--help"], ["plan", str(manifest)]):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    assert not (manifest.parent / "out").exists()  # plan writes nothing


@pytest.mark.parametrize("command", ["", *COMMANDS, "import-checkpoint"])
def test_h_is_help(command: str) -> None:
    run = CliRunner().invoke
    words = command.split()
    short, long = run(cli.app, [*words, "-h"]), run(cli.app, [*words, "--help"])
    assert (short.exit_code, long.exit_code) == (0, 0)
    assert short.output == long.output
    assert "Usage" in short.output


def test_it_prints_its_version(dfrf: Any) -> None:
    assert dfrf("--version") == (0, f"dfrf {metadata.version('dfrf')}\n", "")


def test_without_an_installation_there_is_no_version_but_no_traceback_either(
    dfrf: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", nothing)
    code, out, _ = dfrf("--version")
    assert code == 0
    assert "without having been installed" in out


def test_a_shell_completes_commands() -> None:
    # Under pytest the program would have another name.
    code = "import sys; sys.argv = ['dfrf']; from dubbing.cli.main import main; main()"
    asked = {"_DFRF_COMPLETE": "complete_bash", "COMP_WORDS": "dfrf pl", "COMP_CWORD": "1"}
    printed = subprocess.check_output(
        [sys.executable, "-c", code], env=os.environ | asked, text=True
    )
    assert printed == "plan\n"


def test_the_module_of_the_name_is_the_tool_and_loads_no_torch() -> None:
    code = (
        "import runpy, sys; sys.argv = ['dfrf', 'plan', '-h']\n"
        "try: runpy.run_module('dfrf', run_name='__main__')\n"
        "except SystemExit as end: assert not end.code\n"
        "assert 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "MANIFEST" in done.stdout


FIGURES = Figures(0.2, 0.7, 0.6, 0.05, 0.05, 0.3, 0.1, 0.4, None)


class Film(Stage):
    """A video that lies there already."""


@pytest.mark.parametrize("confidence", [0.05, 0.12, 0.25])
def test_sync_beside_the_source_prints_what_the_report_has(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, confidence: float
) -> None:
    video = tmp_path / "video.mp4"
    video.write_bytes((footage / "ann.mp4").read_bytes())

    def measured(path: Path, *, source: SyncResult | None = None, **_: Any) -> SyncResult:
        best = Estimate(0, confidence if path == video else 0.27, 1.0)
        facts = Media(250, "25", 10.0, 10.0, 9.0, 9.0)
        face = FaceResult(0, 0.5, 0.5, 9.0, 0, best.confidence, FIGURES)
        film = film_face(source, "ours", (0.5, 0.5))
        found = Measurement(best, [1.0] * len(OFFSETS), 25.0, 0, film=film, faces=[face])
        return conclude(found, "ours", facts, source, tracked=True)

    monkeypatch.setattr("dubbing.sync.check.check", measured)
    composite = Film(folder=tmp_path)
    own = CheckSource(folder=tmp_path / "own", clip=footage / "ann.mp4", weights={}, frames=75)
    stage = Check(
        folder=tmp_path / "check",
        video=composite,
        source=own,
        codec="h264",
        options={},
        spoken=((0, 75),),
        credits=0,
        weights={},
    )
    for one in (own, stage):
        one.folder.mkdir()
        one.run(one.folder, lambda message, share: None)
    in_report = json.loads((stage.folder / SYNC_FILE).read_text())
    call = ["sync", str(video), "--source", str(footage / "ann.mp4"), "--json"]
    result = CliRunner().invoke(cli.app, call)
    assert json.loads(result.stdout) == in_report
    assert result.exit_code == (3 if in_report["verdict"] == "fail" else 0)
    if confidence == 0.12:
        assert in_report["verdict"] == "warn"
        alone = CliRunner().invoke(cli.app, ["sync", str(video), "--json"])
        assert json.loads(alone.stdout)["verdict"] == "pass"


def test_every_command_is_there(dfrf) -> None:  # type: ignore[no-untyped-def]
    _, out, _ = dfrf("--help")
    assert all(command in out for command in (*COMMANDS, "import-checkpoint"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["dub", "nothing.yaml"], "no such file"),
        (["dub", "{m}", "--only", "nobody"], "nothing is called nobody"),
        (["dub", "{m}", "--force", "everything"], "no stage 'everything'"),
        (["dub", "{m}", "--device", "tpu"], "no device 'tpu'"),
        (["dub", "{m}", "--jobs", "0"], "--jobs"),
        (["dub"], "MANIFEST"),
        (["sync", "nothing.mp4"], "nothing.mp4"),
        (["evaluate", "{m}", "--lpips-weights", "{m}"], "m.yaml: weights cannot be read"),
        (["evaluate", "{m}", "--protocol", "p16"], "no protocol is called p16"),
        (["evaluate", "{m}", "--every", "0"], "--every"),
        (["evaluate", "{m}", "--method", "dfrf-9"], "no method is called dfrf-9"),
        (["evaluate", "{m}", "--method", "nerf", "--references", "2"], "has no references"),
        (["train-base", "{m}", "--out", "b", "--method", "x"], "no method is called x"),
        (["prepare", "{m}", "--size", "60"], "use 64 to 1024 in steps of 8"),
        (["prepare", "{m}", "--size", "100"], "no head crop of 100 px"),
        (["paint"], "paint"),
        (["sync", "{m}", "--source", "{m}", "--weights", "{m}"], "judges by our network only"),
    ],
)
def test_a_wrong_call_is_2(dfrf, manifest: Path, arguments: list[str], message: str) -> None:  # type: ignore[no-untyped-def]
    code, out, err = dfrf(*(argument.format(m=manifest) for argument in arguments))
    assert code == 2
    assert message in out + err
    assert not (manifest.parent / "out").exists()  # nothing was started


def test_init_writes_a_manifest_that_asks_for_consent_only(dfrf, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    clips.write_clip(tmp_path / "ann.mp4", 50)
    clips.write_clip(tmp_path / "bob: it's.mp4", 50)
    clips.write_sound(tmp_path / "ann_it.wav", 1)
    clips.write_sound(tmp_path / "all.wav", 1)
    (tmp_path / "notes.txt").write_text("no media")
    code, out, _ = dfrf("init", tmp_path)
    assert code == 0
    path = tmp_path / "manifest.yaml"
    assert str(path) in out
    code, _, err = dfrf("plan", path)
    assert code == 2
    # A name with ':' cannot be a folder's everywhere, so it is said too.
    assert "consent.by: must not be empty" in err
    text = path.read_text().replace('by: "", reference: ""', 'by: "Ann", reference: "letter"')
    path.write_text(text.replace('"bob: it\'s":', "bob:").replace('"bob: it\'s",', "bob,"))
    code, out, err = dfrf("plan", "--json", path)
    assert code == 0, err
    dubs = {row["name"] for row in json.loads(out)["stages"] if row["kind"] == "dub"}
    assert dubs == {"ann_it"}
    assert '  # - {identity: "", audio: "all.wav"}' in text
    assert dfrf("init", tmp_path)[0] == 2  # an existing manifest is left alone


def test_a_current_folder_that_is_gone_is_2(tmp_path: Path) -> None:
    code = (
        f"from dubbing.cli.main import main; import os; os.chdir({str(tmp_path)!r})\n"
        f"os.rmdir({str(tmp_path)!r}); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "plan", "m.yaml"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "dfrf: the current folder is gone: change to another\n"


def test_controls_in_a_path_do_not_reach_the_terminal(dfrf: Any, tmp_path: Path) -> None:
    code, _, err = dfrf("plan", tmp_path / "\x1b[31m.yaml")
    assert code == 2
    assert r"\x1b[31m.yaml" in err
    assert "\x1b" not in err


@pytest.mark.parametrize("seconds", ["inf", "nan", "1e308", "1e999"])
def test_seconds_without_end_are_2(dfrf: Any, manifest: Path, seconds: str) -> None:
    code, out, err = dfrf("evaluate", manifest, "--seconds", seconds)
    assert code == 2
    assert "--seconds" in out + err
    assert not (manifest.parent / "out").exists()
