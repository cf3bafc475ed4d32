"""A package that is missing: one sentence with the command that installs it, before any work."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import tomllib
from importlib import metadata
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from dubbing import __main__ as program
from dubbing import packages
from dubbing.errors import ExplainedError
from tests import clips

pytestmark = pytest.mark.medium


ROOT = Path(__file__).resolve().parents[2]
INSTALL = f"{shlex.quote(sys.executable)} -m pip install 'safetensors>=0.4.5'"
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
    monkeypatch.setitem(sys.modules, "safetensors", None)
    assert dfrf(monkeypatch, folder, *call) == 1
    assert capsys.readouterr().err == f"dfrf: not installed: safetensors: run {INSTALL}\n"
    assert sorted(folder.iterdir()) == before  # nothing was begun


def test_plan_and_doctor_report_it_too(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "safetensors", None)
    assert dfrf(monkeypatch, folder, "plan", "--json", "{m}") == 0
    assert INSTALL in str(json.loads(capsys.readouterr().out)["warnings"])
    monkeypatch.setattr("dubbing.cli.console.out.width", 300)  # so that no command is broken up
    assert dfrf(monkeypatch, folder, "doctor") == 1
    assert INSTALL in capsys.readouterr().out


@pytest.mark.parametrize("name", packages.declared())
def test_every_declared_package_is_looked_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    packages.require()  # all are there
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ExplainedError) as error:
        packages.require()
    assert error.value.what == f"not installed: {name}"
    assert shlex.split(error.value.remedy)[-2:] == ["install", packages.declared()[name]]


@pytest.mark.parametrize("extra", ["cluster", "train"])
def test_the_packages_of_an_extra_are_looked_for_by_who_needs_them(
    extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, package = next(iter(packages.declared(extra).items()))
    monkeypatch.setitem(sys.modules, name, None)
    packages.require()  # a dub does without
    with pytest.raises(ExplainedError) as error:
        packages.require(extra)
    assert error.value.what == f"not installed: {name}"
    assert shlex.split(error.value.remedy)[-2:] == ["install", package]


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


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an environment without pip, on a machine with uv."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(packages, "find_spec", lambda name: None)
    monkeypatch.setattr("shutil.which", lambda name: f"/bin/{name}" if name == "uv" else None)
    return tmp_path


def test_a_command_fits_how_the_environment_was_made(
    prefix: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = f"--python {shlex.quote(sys.executable)}"
    removed = "opencv-python"
    assert packages.command(["torch"]) == f"uv pip install {here} 'torch>=2.6'"
    assert (
        packages.again("torch") == f"uv pip install {here} --reinstall-package torch 'torch>=2.6'"
    )
    assert packages.instead("torch", [removed]).startswith(f"uv pip uninstall {here} {removed} && ")
    (prefix / "uv-receipt.toml").touch()
    assert packages.command(["c2pa"]) == f"uv pip install {here} 'c2pa-python>=0.30'"
    assert packages.again("dfrf") == "uv tool upgrade --reinstall dfrf"
    (prefix / "pipx_metadata.json").touch()
    assert packages.command(["c2pa"]) == "pipx inject dfrf 'c2pa-python>=0.30'"
    assert packages.instead("torch", [removed]) == packages.again("dfrf") == "pipx reinstall dfrf"


def test_without_pip_and_uv_another_pip_fills_the_environment(
    prefix: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert (
        packages.command(["torch"])
        == f"pip --python {shlex.quote(sys.executable)} install 'torch>=2.6'"
    )


def test_a_path_with_spaces_is_quoted_as_windows_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", r"C:\Program Files\Python\python.exe")
    monkeypatch.setattr(sys, "platform", "win32")
    words = r'"C:\Program Files\Python\python.exe" -m pip install "torch>=2.6"'
    assert packages.in_words([*packages.installer(), "torch>=2.6"]) == words


def test_where_dfrf_came_from_is_installed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    packages.declared()  # is kept: of what is really installed

    class Installed:
        url = "file:///home/ann/my%20clone"

        def read_text(self, name: str) -> str | None:
            return json.dumps({"url": self.url}) if name == "direct_url.json" else None

    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed())
    assert packages.again("dfrf").endswith(" '/home/ann/my clone'")
    monkeypatch.setattr(Installed, "url", "https://example.invalid/dfrf.whl")
    assert packages.again("dfrf").endswith(" dfrf")


def test_another_processor_does_without_the_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    packages.declared.cache_clear()
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    monkeypatch.setitem(sys.modules, "embreex", None)
    packages.require()
    with pytest.raises(ExplainedError, match="not packaged for this processor"):
        packages.require_renderer()
    packages.declared.cache_clear()


def test_run_from_its_folder_it_declares_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(name: str) -> list[str]:
        raise metadata.PackageNotFoundError(name)

    packages.declared.cache_clear()
    monkeypatch.setattr("importlib.metadata.requires", gone)
    packages.require()
    assert packages.command(["cv2"]).endswith(" cv2")
    packages.declared.cache_clear()


def test_the_lock_lies_in_the_ranges_and_every_package_is_in_it() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = dict(line.split("==") for line in lines if "==" in line)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for text in [*project["dependencies"], *chain.from_iterable(extras.values())]:
        wanted = Requirement(text)
        if wanted.name != "dfrf":
            assert wanted.specifier.contains(pins[canonicalize_name(wanted.name)]), text
