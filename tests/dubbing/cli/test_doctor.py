"""The command `doctor`."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from dubbing import packages

pytestmark = pytest.mark.medium


def test_doctor_reports_what_is_there(dfrf) -> None:  # type: ignore[no-untyped-def]
    _, out, _ = dfrf("doctor")
    for what in ("Python", "torch", "ffmpeg", "face networks", "OpenCV", "base checkpoint"):
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
    missing = "av,cv2,ffmpeg,imageio_ffmpeg,numpy,scipy,torch,silero_vad,ruamel.yaml"
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
    assert any(
        message.endswith(f"-m pip install {packages.DECLARED['cv2']}") for message in commands
    )
    assert any(
        message.endswith(f"-m pip install {packages.DECLARED['torch']}") for message in commands
    )
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
    from dubbing.cli import doctor as machine
    from dubbing.media import ffmpeg

    ffmpeg.version.cache_clear()
    monkeypatch.setenv("DFRF_FFMPEG", program)
    (found,) = (finding for finding in machine.examine() if finding.what == "ffmpeg")
    assert found.state == "lacking"
    assert message in found.found
    assert "DFRF_FFMPEG" in found.remedy
