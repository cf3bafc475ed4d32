"""Nothing of the current folder is run: no library, no module, no program, no settings."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dubbing.engine import environment
from dubbing.provenance import card

PATHS = ("PATH", "LD_LIBRARY_PATH", "PYTHONPATH", "XDG_DATA_DIRS", "OPENCV_VIDEOIO_PLUGIN_PATH")


def unsettled() -> dict[str, str]:
    """The environment as a user's is: of this process it may be settled."""
    return {name: value for name, value in os.environ.items() if name != environment.SAFE_PATH}


def entries(found: dict[str, str]) -> dict[str, list[str]]:
    return {name: found[name].split(os.pathsep) for name in PATHS if name in found}


@pytest.mark.parametrize("value", ["", ".", ":", "lib", ":/usr/lib", "/usr/lib:", "/a::b:./c:/usr"])
def test_no_search_path_of_a_child_holds_the_current_folder(
    value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in PATHS:
        monkeypatch.setenv(name, value)
    found = entries(environment.of_children())
    assert all(os.path.isabs(entry) for some in found.values() for entry in some)
    kept = [entry for entry in value.split(":") if entry.startswith("/")]
    assert found.get("PATH", []) == kept


def test_opencv_leaves_no_empty_entry_behind(tmp_path: Path) -> None:
    """It puts its folder and a colon before what stands in LD_LIBRARY_PATH."""
    code = (
        "from dubbing.engine import environment as e; e.settle(); import cv2, os; print(os.environ)"
    )
    call = [sys.executable, "-c", f"{code}; print('|', os.environ.get('LD_LIBRARY_PATH'))"]
    own = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    done = subprocess.run(call, capture_output=True, text=True, check=True, env=own)
    found = done.stdout.rpartition("|")[2].strip()
    assert all(os.path.isabs(entry) for entry in found.split(":")), found


@pytest.mark.parametrize("module", ["argparse", "dubbing", "json", "pathlib", "torch"])
def test_no_module_beside_a_film_is_imported_by_a_child(module: str, tmp_path: Path) -> None:
    (tmp_path / f"{module}.py").write_text("raise SystemExit('ran')")
    call = [*environment.python("dubbing.engine.running.task"), "--help"]
    env = environment.of_children()
    done = subprocess.run(call, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_nor_by_python_m_dubbing(tmp_path: Path) -> None:
    """Python puts the current folder first."""
    for module in ("argparse", "typer", "json", "pathlib", "torch"):
        (tmp_path / f"{module}.py").write_text("raise SystemExit('ran')")
    call = [sys.executable, "-m", "dubbing", "--version"]
    env = {**unsettled(), "PYTHONPATH": environment.PACKAGES}
    done = subprocess.run(call, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_nor_by_a_process_that_multiprocessing_starts(tmp_path: Path) -> None:
    """It calls Python with -c, which puts the current folder first."""
    for module in ("multiprocessing", "json", "torch"):
        (tmp_path / f"{module}.py").write_text("raise SystemExit('ran')")
    program = tmp_path.parent / "program.py"  # the film's folder is not that of the program
    program.write_text("""
from dubbing.engine import environment
environment.settle()
import multiprocessing, sys
if __name__ == "__main__":
    process = multiprocessing.get_context("spawn").Process(target=print)
    process.start()
    process.join()
    sys.exit(process.exitcode)
""")
    env = {**unsettled(), "PYTHONPATH": environment.PACKAGES}
    call = [sys.executable, str(program)]
    done = subprocess.run(call, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_letters_that_the_card_lacks() -> None:
    assert card.undrawable("Ann Žižek, Ελλάδα, Юлия\n") == ""
    assert card.undrawable("Ann 李 and שלום") == "李שלום"


def test_the_command_line_loads_without_what_only_unix_has() -> None:
    """Windows has none of these; a command, a plan and a process for a task import all of it."""
    code = """
import os, signal, sys
for name in ("SIGKILL", "SIGHUP", "SIGXCPU", "SIGXFSZ", "SIGUSR1", "SIGALRM"):
    delattr(signal, name)
for name in ("fork", "getuid", "nice", "sched_getaffinity", "getpgid", "killpg"):
    delattr(os, name)
for name in ("resource", "fcntl", "pwd", "grp", "termios"):
    sys.modules[name] = None
import dubbing.cli.doctor.doctor, dubbing.cli.main, dubbing.batch.task, dubbing.batch.batch
import dubbing.cli.console, dubbing.cli.live
import dubbing.engine.running.executors, dubbing.engine.running.task
import dubbing.heads.fine_tuning, dubbing.heads.rendering, dubbing.preparation.prepare
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
