"""Finds and runs the ffmpeg program.

The binary is the one inside the imageio-ffmpeg wheel, so nothing of the system is needed.
``DFRF_FFMPEG`` names another one: a path, or ``system`` for the first on PATH.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from functools import lru_cache
from typing import IO, Any

import imageio_ffmpeg

from dubbing.engine import environment
from dubbing.errors import MediaError

REMEDY = "unset DFRF_FFMPEG to use the one that came with imageio-ffmpeg"
BEGINS = "ffmpeg version "  # how every ffmpeg reports its version
MEANINGS = {
    "SIGKILL": "as when memory runs short",
    "SIGXFSZ": "a file grew larger than is allowed here",
    "SIGXCPU": "it used more processor time than is allowed here",
    "SIGSEGV": "a fault of its own, or a damaged file",
}
CHANGES = "Changing audio frame properties on the fly"  # how ffmpeg reports that
QUIET = ("-hide_banner", "-loglevel", "error", "-nostdin")


def binary() -> str:
    """Path of the ffmpeg to run.

    Raises:
        MediaError: the program of ``DFRF_FFMPEG`` does not exist, or the wheel has none.
    """
    environment.settle()  # PATH is searched, and imageio-ffmpeg also runs a program
    wanted = os.environ.get("DFRF_FFMPEG", "")
    if not wanted:
        try:
            return str(imageio_ffmpeg.get_ffmpeg_exe())
        except RuntimeError as error:
            remedy = "set DFRF_FFMPEG to the path of an ffmpeg"
            raise MediaError("no ffmpeg found", "imageio-ffmpeg", remedy) from error
    program = shutil.which("ffmpeg" if wanted == "system" else wanted)
    if program is None:
        raise MediaError("no ffmpeg found", f"DFRF_FFMPEG={wanted}", REMEDY)
    return program


@lru_cache(maxsize=1)
def version() -> str:
    """First line of ``ffmpeg -version``, without the copyright.

    Raises:
        MediaError: there is no ffmpeg, or it does not run.
    """
    program = binary()
    try:
        done = subprocess.run(
            [program, "-version"], capture_output=True, check=False, env=environment.of_children()
        )
        code = done.returncode
        ended = f"by {signal_of(code)}" if code < 0 else f"with {code}"
        text, what = done.stdout.decode(errors="replace"), f"it ended {ended}"
    except OSError as error:
        text, what = "", str(error.strerror)
    if not text.startswith(BEGINS):
        raise MediaError(f"ffmpeg does not run: {what}", program, REMEDY)
    return text.splitlines()[0].split(" Copyright")[0].removeprefix(BEGINS)


class Process:
    """A running ffmpeg with one pipe, either its input or its output.

    Its messages go to a temporary file, because an unread pipe of messages can block it.
    """

    def __init__(self, graph: Any, where: str, *, pipe_in: bool = False, pipe_out: bool = False):
        self.where = where
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115 (closed by kill)
        command = graph.global_args(*QUIET).compile(cmd=binary(), overwrite_output=True)
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE if pipe_in else subprocess.DEVNULL,
            stdout=subprocess.PIPE if pipe_out else subprocess.DEVNULL,
            stderr=self._messages,
            env=environment.of_children(),
        )

    @property
    def stdin(self) -> IO[bytes]:
        assert self._process.stdin is not None
        return self._process.stdin

    @property
    def stdout(self) -> IO[bytes]:
        assert self._process.stdout is not None
        return self._process.stdout

    def fill(self, buffer: memoryview) -> bool:
        """Read so many bytes from its output; false where it ends before."""
        filled, view = 0, buffer.cast("B")
        while filled < len(view):
            got = self.stdout.readinto(view[filled:])  # type: ignore[attr-defined]
            if not got:
                return False
            filled += got
        return True

    def finish(self) -> None:
        """Close the pipe and wait.

        Raises:
            MediaError: ffmpeg failed; the end of its messages is included.
        """
        if self._process.stdin is not None:
            # A broken pipe means it ended early: its return code and its messages tell why.
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()
        if code := self._process.wait():
            if CHANGES in self.words(100):
                raise changing_sound(self.where)
            killed = f"was ended by the system: {signal_of(code)}" if code < 0 else "failed"
            raise MediaError(f"ffmpeg {killed}", self.where, self.words())

    def words(self, lines: int = 3) -> str:
        """The last lines that ffmpeg wrote."""
        self._messages.seek(0)
        written = self._messages.read().decode(errors="replace").strip().splitlines()
        return " | ".join(written[-lines:])

    def kill(self) -> None:
        """Kill it, if it still runs, and close its pipes."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        for stream in (self._process.stdout, self._messages):
            if stream is not None:
                stream.close()

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


def changing_sound(where: str) -> MediaError:
    """The error of sound that cannot be read as one."""
    what = "its sound changes its channels or its rate on the way"
    return MediaError(what, where, "convert it, to sound of one kind")


def signal_of(code: int) -> str:
    """The signal in the exit code of a process, in words."""
    try:
        name = signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
    meaning = MEANINGS.get(name) or str(signal.strsignal(-code)).lower()
    return f"signal {-code}, {name}, {meaning}"


def run(graph: Any, where: str) -> None:
    """Run an ffmpeg-python graph to its end.

    Raises:
        MediaError: it failed.
    """
    with Process(graph, where) as process:
        process.finish()
