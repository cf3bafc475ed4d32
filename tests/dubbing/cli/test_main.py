from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from dubbing.cli import main as cli
from dubbing.engine import lock
from dubbing.stages import tasks
from dubbing.sync.curves import OFFSETS, Estimate
from dubbing.sync.result import Found, Media, SyncResult, conclude
from tests import clips, fakes

CONSENT = '{by: "the person on film", reference: "form 17"}'
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


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("footage")
    clips.write_clip(folder / "ann.mp4", 30)
    clips.write_sound(folder / "ann_it.wav", 0.6)
    return folder


@pytest.fixture
def manifest(footage: Path, tmp_path: Path) -> Path:
    path = tmp_path / "m.yaml"
    path.write_text(
        f"""
version: 1
output: out
identities: {{ann: {{clip: {footage}/ann.mp4, seconds: 1, consent: {CONSENT}}}}}
dubs: [{{name: it, identity: ann, audio: {footage}/ann_it.wav}}]
"""
    )
    return path


@pytest.fixture
def dfrf(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> object:
    """Run the command line with stand-ins; gives exit code, output and errors."""
    fakes.install(monkeypatch.setattr)
    before = signal.getsignal(signal.SIGTERM)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dfrf", *map(str, arguments)])
        try:
            cli.main()
            code: object = 0
        except SystemExit as end:
            code = end.code or 0
        finally:
            signal.signal(signal.SIGTERM, before)
        assert isinstance(code, int)
        told = capsys.readouterr()
        return code, told.out, told.err

    return run


def test_help_and_plan_load_no_torch(manifest: Path) -> None:
    code = (
        "import sys; from dubbing.cli.main import app\n"
        "try: app(sys.argv[1:])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert 'torch' not in sys.modules and 'mediapipe' not in sys.modules"
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


def test_it_says_its_version(dfrf: Any) -> None:
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
    told = subprocess.check_output([sys.executable, "-c", code], env=os.environ | asked, text=True)
    assert told == "plan\n"


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


@pytest.mark.parametrize("confidence", [0.05, 0.12, 0.25])
def test_sync_beside_the_source_says_what_the_report_says(
    footage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, confidence: float
) -> None:
    video = tmp_path / "dub.mp4"
    video.write_bytes((footage / "ann.mp4").read_bytes())

    def measured(path: Path, *, source: SyncResult | None = None, **_: Any) -> SyncResult:
        best = Estimate(0, confidence if path == video else 0.27, 1.0)
        facts = Media(250, "25", 10.0, 10.0, 9.0, 9.0)
        found = Found(best, [1.0] * len(OFFSETS), 25.0, 0)
        return conclude(found, "ours", facts, source, tracked=True)

    monkeypatch.setattr("dubbing.sync.check.check", measured)
    own = tmp_path / "own"
    for folder, task in (
        (own, tasks.Check(footage / "ann.mp4")),
        (tmp_path, tasks.Check(video, own / tasks.SYNC_FILE)),
    ):
        folder.mkdir(exist_ok=True)
        task(folder, lambda message, share: None)
    in_report = json.loads((tmp_path / tasks.SYNC_FILE).read_text())
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


@pytest.mark.parametrize(
    ("arguments", "said"),
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
        (["prepare", "{m}", "--size", "60"], "use 64 to 1024 in steps of 8"),
        (["prepare", "{m}", "--size", "100"], "no head crop of 100 px"),
        (["paint"], "paint"),
        (["sync", "{m}", "--source", "{m}", "--weights", "{m}"], "judges by our network only"),
    ],
)
def test_a_wrong_call_is_2(dfrf, manifest: Path, arguments: list[str], said: str) -> None:  # type: ignore[no-untyped-def]
    code, out, err = dfrf(*(argument.format(m=manifest) for argument in arguments))
    assert code == 2
    assert said in out + err
    assert not (manifest.parent / "out").exists()  # nothing was started


def test_a_gpu_that_is_not_there_is_2(  # type: ignore[no-untyped-def]
    dfrf, manifest: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    code, _, err = dfrf("dub", manifest, "--device", "cuda")
    assert code == 2
    assert "torch sees no GPU here (--device cuda): use auto or cpu" in err
    assert not (manifest.parent / "out").exists()


def test_a_wrong_manifest_is_2_and_all_is_said(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    manifest.write_text(manifest.read_text().replace("version: 1", "version: 3\nlabel: x"))
    code, _, err = dfrf("dub", manifest)
    assert code == 2
    assert "2 problems" in err
    assert "line 2: version: must be 1" in err
    assert "line 3: label: unknown key" in err


def test_a_locked_folder_is_2(dfrf, manifest: Path) -> None:  # type: ignore[no-untyped-def]
    with lock.hold(manifest.parent / "out" / "work"):
        code, _, err = dfrf("dub", manifest)
    assert code == 2
    assert f"process {os.getpid()}" in err


def test_a_folder_that_cannot_be_made_is_said(  # type: ignore[no-untyped-def]
    dfrf, manifest: Path, footage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (manifest.parent / "file").touch()
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", manifest.parent / "file" / "out")
    assert code == 1
    assert "the folder cannot be made: Not a directory" in err
    # Whoever runs the tests may be allowed everything.
    monkeypatch.setattr(os, "access", lambda _, mode: not mode & os.W_OK)
    for arguments in (("dub", manifest), ("init", footage)):
        code, _, err = dfrf(*arguments)
        assert code == 1
        assert "nothing may be written there" in err


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


def test_a_failed_job_is_1(dfrf, manifest: Path, footage: Path) -> None:  # type: ignore[no-untyped-def]
    (footage / "noface.mp4").write_bytes((footage / "ann.mp4").read_bytes())
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
    from dubbing.stages import tasks

    finetune = tasks.Finetune.__call__
    # Whoever starts the tests in the background has SIGINT ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))

    def interrupted(*_arguments: object) -> None:
        os.kill(os.getpid(), number)
        time.sleep(60)
        raise AssertionError("the signal did not interrupt the run")

    monkeypatch.setattr(tasks.Finetune, "__call__", interrupted)
    code, _, err = dfrf("dub", manifest)
    assert code == 130
    assert "run the same command again" in err
    monkeypatch.setattr(tasks.Finetune, "__call__", finetune)
    assert dfrf("dub", manifest)[0] == 0


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
    assert dubs == {"ann_ann_it"}
    assert '  # - {identity: "", audio: "all.wav"}' in text
    assert dfrf("init", tmp_path)[0] == 2  # an existing manifest is left alone


def test_doctor_says_what_is_there(dfrf) -> None:  # type: ignore[no-untyped-def]
    _, out, _ = dfrf("doctor")
    for what in ("Python", "torch", "ffmpeg", "mediapipe", "OpenCV", "base checkpoint"):
        assert what in out


def test_doctor_works_where_everything_is_missing() -> None:
    """It is there for a machine on which the installation went wrong."""
    code = (
        "import sys; sys.modules.update(dict.fromkeys(sys.argv[1].split(',')))\n"
        "from dubbing.cli import doctor\n"
        "doctor._version = lambda package: ''\n"
        "from dubbing.cli.main import app\n"
        "app(['doctor'])"
    )
    missing = "av,cv2,ffmpeg,imageio_ffmpeg,mediapipe,numpy,scipy,torch,webrtcvad,yaml"
    done = subprocess.run(
        [sys.executable, "-c", code, missing],
        env={**os.environ, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (1, "")
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done.stdout.splitlines()]
    assert ["OpenCV", "lacking", "not installed", "make install"] in rows
    assert ["graphics card", "lacking", "torch is not there", "make install"] in rows
    assert any(row[:2] == ["ffmpeg", "lacking"] for row in rows if row)


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("/bin/false", "it ended with 1"),
        ("/bin/true", "it ended with 0"),
        ("nothing", "no ffmpeg found"),
    ],
)
def test_doctor_says_that_ffmpeg_is_broken(
    program: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dubbing.cli import doctor as machine
    from dubbing.media import ffmpeg

    ffmpeg.version.cache_clear()
    monkeypatch.setenv("DFRF_FFMPEG", program)
    (found,) = (finding for finding in machine.examine() if finding.what == "ffmpeg")
    assert found.state == "lacking"
    assert said in found.found
    assert "DFRF_FFMPEG" in found.remedy


def test_a_file_that_cannot_be_written_is_refused_before_anything_is_trained(
    dfrf: Any, manifest: Path, footage: Path, tmp_path: Path
) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "file").write_text("")
    clip = footage / "ann.mp4"
    for call in (
        ("train-base", manifest, "--out"),
        ("train-sync", clip, "--out"),
        ("train-speech",),
    ):
        code, _, err = dfrf(*call, tmp_path / "taken")
        assert code == cli.FAILED
        assert "a folder, not a file to write" in err
        code, _, err = dfrf(*call, tmp_path / "file" / "net.safetensors")
        assert code == cli.FAILED
        assert "the folder cannot be made" in err


def in_a_process(*arguments: object, output: str) -> tuple[int, str]:
    """Exit code of a run whose output goes to a file, and what it said of errors."""
    with open(output, "w") as stream:
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                "from dubbing.cli.main import main; main()",
                *map(str, arguments),
            ],
            stdout=stream,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    return done.returncode, done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["plan", "--json"], ["plan"]])
def test_output_that_cannot_be_written_is_1(manifest: Path, arguments: list[str]) -> None:
    path = [manifest] if arguments[0] == "plan" else []
    code, err = in_a_process(*arguments, *path, output="/dev/full")
    assert code == 1
    assert err == "dfrf: No space left on device: free some space, then run again\n"


def test_a_current_folder_that_is_gone_is_2(tmp_path: Path) -> None:
    code = (
        f"from dubbing.cli.main import main; import os; os.chdir({str(tmp_path)!r})\n"
        f"os.rmdir({str(tmp_path)!r}); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "plan", "m.yaml"],
        capture_output=True,
        text=True,
        check=False,
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


@pytest.fixture
def preparing(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders that `prepare` was called for; it leaves there what it would."""
    found: list[Path] = []

    def work(clip: Path, out: Path, **_: object) -> object:
        found.append(out)
        return fakes.write_prepared(clip, out)

    monkeypatch.setattr("dubbing.preparation.prepare", work)
    return found


def test_prepare_takes_an_empty_folder_or_its_own(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    clip, out = footage / "ann.mp4", tmp_path / "out"
    for _ in range(2):
        code, _, err = dfrf("prepare", clip, "--out", out)
        assert code == 0, err
    cut_short = tmp_path / "cut_short"
    (cut_short / "steps").mkdir(parents=True)
    (cut_short / "steps" / ".key.17.tmp.json").touch()
    assert dfrf("prepare", clip, "--out", cut_short)[0] == 0
    assert preparing == [out, out, cut_short]


@pytest.mark.parametrize("name", ["notes.txt", "steps/mine.txt", "matte.mkv"])
def test_prepare_refuses_a_folder_with_other_files(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path], name: str
) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("precious")
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", tmp_path)
    assert (code, preparing) == (2, [])
    assert "other files lie there" in err
    assert "name an empty folder" in err
    assert (tmp_path / name).read_text() == "precious"


def test_prepare_refuses_no_folder_and_its_own_clip(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", "")
    assert code == 2
    assert "names no folder (--out)" in err
    fakes.write_prepared(footage / "ann.mp4", tmp_path)
    code, _, err = dfrf("prepare", tmp_path / "matte.mkv", "--out", tmp_path)
    assert code == 2
    assert "the clip itself would be overwritten" in err
    assert preparing == []


def test_two_at_once_into_one_folder_are_2(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    with lock.hold(tmp_path):
        code, _, err = dfrf("prepare", footage / "ann.mp4", "--out", tmp_path)
    assert (code, preparing) == (2, [])
    assert f"another run is at work ({tmp_path}): wait for process {os.getpid()}" in err


@pytest.mark.parametrize("link", [None, os.link, os.symlink])
def test_a_checkpoint_is_not_imported_onto_itself(dfrf: Any, tmp_path: Path, link: Any) -> None:
    file = out = tmp_path / "head.tar"
    file.write_bytes(b"PK weights")
    if link:
        out = tmp_path / "out.safetensors"
        link(file, out)
    code, _, err = dfrf("import-checkpoint", file, out)
    assert code == 2
    assert "it is read, so it cannot be written" in err
    assert file.read_bytes() == b"PK weights"


def test_a_clip_whose_name_is_no_utf8_is_refused_before_it_is_prepared(
    dfrf: Any, footage: Path, tmp_path: Path, preparing: list[Path]
) -> None:
    clip = tmp_path / os.fsdecode(b"\xff.mp4")
    clip.write_bytes((footage / "ann.mp4").read_bytes())
    code, _, err = dfrf("prepare", clip)
    assert (code, preparing) == (2, [])
    assert "its name is no UTF-8: rename the file" in err


def test_a_base_is_not_trained_onto_what_it_learns_from(
    dfrf: Any, manifest: Path, footage: Path
) -> None:
    for out in (manifest, footage / "ann.mp4"):
        code, _, err = dfrf("train-base", manifest, "--out", out)
        assert code == 2
        assert "it is read, so it cannot be written" in err
