"""A package that is missing: one sentence with the command that installs it, before any work."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from dubbing import __main__ as program
from dubbing import packages
from dubbing.errors import ExplainedError
from tests import clips

pytestmark = pytest.mark.medium


ROOT = Path(__file__).resolve().parents[2]
INSTALL = f"{shlex.quote(sys.executable)} -m pip install silero-vad==6.2.3"
CALLS = (
    ("dub", "{m}"),
    ("prepare", "{clip}"),
    ("sync", "{clip}"),
    ("evaluate", "{m}"),
    ("train-base", "{m}", "--out", "{out}"),
    ("train-speech", "{out}"),
    ("train-sync", "{clip}", "--out", "{out}"),
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    clips.write_clip(tmp_path / "ann.mp4", 30)
    clips.write_sound(tmp_path / "it.wav", 0.6)
    (tmp_path / "m.yaml").write_text(
        f"version: 1\noutput: out\n"
        f"identities: {{ann: {{clip: ann.mp4, seconds: 1, consent: {clips.CONSENT}}}}}\n"
        f"dubs: [{{name: it, identity: ann, audio: it.wav}}]\n"
    )
    return tmp_path


def dfrf(monkeypatch: pytest.MonkeyPatch, folder: Path, *arguments: str) -> object:
    """Calls the command line; gives what it ended with."""
    places = {"m": folder / "m.yaml", "clip": folder / "ann.mp4", "out": folder / "net"}
    call = [argument.format(**places) for argument in arguments]
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(sys, "argv", ["dfrf", *call])
    with pytest.raises(SystemExit) as end:
        program.main()
    return end.value.code


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call[0])
def test_a_run_names_first_what_to_install(
    call: tuple[str, ...],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = sorted(folder.iterdir())
    monkeypatch.setitem(sys.modules, "silero_vad", None)
    assert dfrf(monkeypatch, folder, *call) == 1
    assert capsys.readouterr().err == f"dfrf: not installed: silero_vad: run {INSTALL}\n"
    assert sorted(folder.iterdir()) == before  # nothing was begun


def test_plan_and_doctor_report_it_too(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "silero_vad", None)
    assert dfrf(monkeypatch, folder, "plan", "--json", "{m}") == 0
    assert INSTALL in str(json.loads(capsys.readouterr().out)["warnings"])
    monkeypatch.setattr("dubbing.cli.console.out.width", 300)  # so that no command is broken up
    assert dfrf(monkeypatch, folder, "doctor") == 1
    assert INSTALL in capsys.readouterr().out


@pytest.mark.parametrize("name", packages.DECLARED)
def test_every_declared_package_is_looked_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    packages.require()  # all are there
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ExplainedError) as error:
        packages.require()
    assert error.value.what == f"not installed: {name}"
    assert error.value.remedy.endswith(f" -m pip install {packages.DECLARED[name]}")


@pytest.mark.parametrize("extra", ["synthetic", "train"])
def test_the_packages_of_an_extra_are_looked_for_by_who_needs_them(
    extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, pinned = next(iter(packages.EXTRAS[extra].items()))
    monkeypatch.setitem(sys.modules, name, None)
    packages.require()  # a dub does without
    with pytest.raises(ExplainedError) as error:
        packages.require(extra)
    assert error.value.what == f"not installed: {name}"
    assert error.value.remedy.endswith(f" -m pip install {pinned}")


def test_the_synthetic_speaker_names_what_to_install(tmp_path: Path) -> None:
    code = (
        "import runpy, sys; sys.modules['embreex'] = None; sys.argv[0] = 'speaker'\n"
        "runpy.run_module('dubbing.workshop.synthetic', run_name='__main__')"
    )
    call = [sys.executable, "-c", code, str(tmp_path), "--identities", "1"]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: not installed: embreex: run ")
    assert done.stderr.count("\n") == 1


def test_a_dub_imports_no_package_of_an_extra() -> None:
    """What a dub runs loads neither the synthetic speaker nor what only training needs."""
    code = (
        "import sys\n"
        "for name in ('embreex', 'espeakng_loader', 'pocketsphinx', 'distributed'):\n"
        "    sys.modules[name] = None\n"
        "import dubbing.batch.batch, dubbing.workshop.lab.evaluation, dubbing.preparation.prepare\n"
        "import dubbing.video.assembly, dubbing.heads.fine_tuning\n"
        "import dubbing.sound_to_lips.cue_speech\n"
        "import dubbing.heads.pose_refinement, dubbing.heads.rendering, dubbing.sync.check\n"
        "import dubbing.speech.rnn_features, dubbing.workshop.training.base"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["typer", "ruamel.yaml", "numpy", "annotated_types"])
def test_what_cannot_even_be_loaded_is_no_traceback(name: str, folder: Path) -> None:
    code = (
        "import sys; sys.modules[sys.argv.pop(1)] = None\nfrom dubbing.__main__ import main\nmain()"
    )
    call = [sys.executable, "-c", code, name, "plan", str(folder / "m.yaml")]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"dfrf: not installed: {name}: run ")
    assert done.stderr.count("\n") == 1


def test_the_commands_are_those_of_the_lock() -> None:
    def pins(name: str) -> list[str]:
        return (ROOT / f"requirements{name}.txt").read_text().split()

    lock = pins("")
    torch = "torch==2.13.0"
    assert torch in (ROOT / "Makefile").read_text()
    assert set(packages.DECLARED.values()) <= {*lock, torch}
    assert set(packages.SYNTHETIC.values()) == set(pins("-synthetic"))
    assert set(packages.CLUSTER.values()) <= {*pins("-cluster")}
    assert set(packages.EXTRAS["train"].values()) <= {*pins("-synthetic"), *pins("-dev")}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for declared, pinned in (
        (project["dependencies"], packages.DECLARED),
        *((extras[name], packages.EXTRAS[name]) for name in packages.EXTRAS),
    ):
        names = [re.split("[=<>]", text)[0].lower() for text in declared]
        assert sorted(names) == sorted(text.split("==")[0].lower() for text in pinned.values())
