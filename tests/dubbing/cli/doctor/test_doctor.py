"""The command `doctor`."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from base64 import urlsafe_b64encode
from importlib.metadata import PathDistribution
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from dfrf.device import choose
from dubbing.cli.doctor import doctor as machine
from dubbing.cli.doctor import hardware, self_tests
from dubbing.cli.doctor.self_tests import TESTS
from dubbing.packages import declared

pytestmark = pytest.mark.medium


def test_doctor_reports_what_is_there(dfrf) -> None:  # type: ignore[no-untyped-def]
    _, out, _ = dfrf("doctor")
    for what in ("Python", "dfrf", "torch", "ffmpeg", "OpenCV", "memory", "disk", *TESTS):
        assert what in out


def test_doctor_works_where_everything_is_missing() -> None:
    """It is there for a machine on which the installation went wrong."""
    code = (
        "import sys; sys.modules.update(dict.fromkeys(sys.argv[1].split(',')))\n"
        "from dubbing.cli.doctor import doctor\n"
        "doctor._version = lambda package: ''\n"
        "from dubbing.cli.main import app\n"
        "app(['doctor'])"
    )
    missing = "av,cv2,ffmpeg,imageio_ffmpeg,numpy,scipy,torch,safetensors,ruamel.yaml"
    done = subprocess.run(
        [sys.executable, "-c", code, missing],
        env={**os.environ, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (1, "")
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done.stdout.splitlines()]
    assert ["OpenCV", "lacking", "not installed"] in rows
    assert ["graphics card", "lacking", "torch is not installed"] in rows
    commands = [message for message in done.stdout.splitlines() if message.startswith("to do: ")]
    assert len(commands) == len(set(commands))
    for name in ("cv2", "torch"):
        assert any(message.endswith(f" install '{declared()[name]}'") for message in commands)
    assert any(row[:2] == ["ffmpeg", "lacking"] for row in rows if row)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("/bin/false", "it ended with 1"),
        ("/bin/true", "it ended with 0"),
        ("nothing", "no ffmpeg found"),
    ],
)
def test_doctor_reports_that_ffmpeg_is_broken(
    program: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dubbing.media.opening import ffmpeg

    ffmpeg.version.cache_clear()
    monkeypatch.setenv("DFRF_FFMPEG", program)
    (found,) = (finding for finding in machine.examine() if finding.what == "ffmpeg")
    assert found.state == "lacking"
    assert message in found.found
    assert "DFRF_FFMPEG" in found.remedy


def test_every_network_computes_what_it_should() -> None:
    found = self_tests.self_tests()
    assert [finding.what for finding in found] == [*TESTS]
    assert {finding.found for finding in found} == {"computes what it should"}


@pytest.mark.parametrize("name", [name for name in TESTS if name != "face networks"])
def test_a_network_that_computes_something_else_is_found(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = torch.nn.functional.linear, torch.conv1d
    wrong = [
        lambda x, *rest, inner=inner, **more: inner(x, *rest, **more) * (1.1 - 0.1 * is_double(x))
        for inner in exact
    ]
    monkeypatch.setattr("torch.nn.functional.linear", wrong[0])
    monkeypatch.setattr("torch.nn.functional.conv1d", wrong[1])
    found = self_tests._finding(name, TESTS[name])
    assert (found.state, found.found.split(": ")[0]) == (
        "lacking",
        "other results than it should give",
    )
    assert found.remedy.endswith("'torch>=2.6'")


def is_double(x: torch.Tensor) -> bool:
    return x.dtype == torch.float64


def test_a_file_that_changed_since_it_was_installed_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "dfrf-9.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dfrf\nVersion: 9\n")
    (tmp_path / "dubbing").mkdir()
    rows = []
    for name in ("whole", "damaged", "gone"):
        (tmp_path / "dubbing" / name).write_text(name)
        digest = urlsafe_b64encode(hashlib.sha256(name.encode()).digest()).decode().rstrip("=")
        rows.append(f"dubbing/{name},sha256={digest},{len(name)}")
    (info / "RECORD").write_text("\n".join([*rows, "../bin/dfrf,sha256=other,3"]))
    monkeypatch.setattr(machine.metadata, "files", lambda _: PathDistribution(info).files)
    assert machine._dfrf().state == "fine"
    (tmp_path / "dubbing" / "damaged").write_text("x")
    (tmp_path / "dubbing" / "gone").unlink()
    assert "since it was installed: damaged, gone" in machine._dfrf().found


def test_a_second_opencv_is_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        machine, "_version", lambda name: "" if name == "opencv-contrib-python" else "4"
    )
    found = machine._opencv()
    assert found.state == "lacking"
    removal, again = found.remedy.split(" && ")
    assert removal.endswith("pip uninstall -y opencv-python opencv-python-headless")
    assert again.endswith(f" '{declared()['cv2']}'")


def test_windows_has_memory_and_cores_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    class Library:
        @staticmethod
        def GetPhysicallyInstalledSystemMemory(place: Any) -> None:  # noqa: N802 (Windows')
            place._obj.value = 8 * 2**20

    monkeypatch.delattr("os.sysconf")
    monkeypatch.delattr("os.sched_getaffinity")
    monkeypatch.setattr("ctypes.windll", SimpleNamespace(kernel32=Library), raising=False)
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: (_ for _ in ()).throw(OSError()))
    assert hardware.memory().found == "8.0 GiB"
    assert hardware.processor().found == f"{os.cpu_count()} cores"


def test_apples_graphics_card_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    monkeypatch.setattr("torch.backends.mps.is_available", lambda: True)
    assert choose("auto").type == "cpu"
    assert hardware.graphics().found == "Apple's is not used; the processor does it all"
