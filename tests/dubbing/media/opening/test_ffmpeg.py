"""How ffmpeg's end is told."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from dubbing.errors import MediaError
from dubbing.media.opening import ffmpeg


class Graph:
    """A call of another program in ffmpeg's place."""

    def __init__(self, *command: str) -> None:
        self.command = command

    def global_args(self, *_: str) -> Any:
        return self

    def compile(self, **_: Any) -> list[str]:
        return [*self.command]


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (signal.SIGKILL, "signal 9, SIGKILL, as when memory runs short"),
        (signal.SIGXFSZ, "SIGXFSZ, a file grew larger than is allowed here"),
        (signal.SIGTERM, "SIGTERM, terminated"),
        (40, "signal 40"),
    ],
)
def test_a_signal_that_ended_it_is_named(number: int, words: str) -> None:
    with pytest.raises(MediaError, match=f"ffmpeg was ended by the system: .*{words}"):
        ffmpeg.run(Graph("sh", "-c", f"kill -{int(number)} $$"), "a.mp4")


def test_an_exit_code_is_its_own_word() -> None:
    with pytest.raises(MediaError, match=r"ffmpeg failed \(a\.mp4\): no such filter"):
        ffmpeg.run(Graph("sh", "-c", "echo no such filter >&2; exit 1"), "a.mp4")


def test_no_program_of_the_current_folder_is_taken_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "ffmpeg"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f":.{os.pathsep}/nowhere")
    monkeypatch.setenv("DFRF_FFMPEG", "system")
    with pytest.raises(MediaError, match="no ffmpeg found"):
        ffmpeg.binary()
