"""`dfrf dub` of one dub, started and watched from the page."""

from __future__ import annotations

import io
import json
import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from dubbing.engine.forks import CONTEXT, process
from dubbing.errors import ExplainedError

INTERRUPTED = 130
ENDS = {0: "made", 3: "made; its sync check failed"}
# By exit code; the second where the signal came before it was listened to.
ENDS |= dict.fromkeys((INTERRUPTED, -signal.SIGTERM), "stopped; it goes on where it was")


class _Printed(io.RawIOBase):
    """Sends all that is written."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._pipe.send_bytes(data)
        return len(data)


def run(program: str, arguments: list[str], pipe: Connection) -> None:
    """Run a program's `main` in the process that was started for it."""
    sys.stdout = sys.stderr = io.TextIOWrapper(_Printed(pipe), "utf-8", write_through=True)  # type: ignore[type-var]
    sys.argv = ["dfrf", *arguments]
    try:
        import_module(program).main()
    except KeyboardInterrupt:  # while it begins or ends, and does not handle it itself
        raise SystemExit(INTERRUPTED) from None


class Making:
    """At most one run at a time, in a process of its own, which another page may have started.

    Args:
        device: auto, cpu or cuda.
        program: a module whose `main` is the command line.
    """

    def __init__(self, manifest: Path, device: str, program: str = "dubbing.__main__") -> None:
        self._program = program
        self._call = ["dub", str(manifest), "--device", device, "--json"]
        self._lock = Lock()
        self._process: Any = None
        self._dub = self._words = ""
        self._done = (0, 0)  # stages, of how many

    def state(self) -> dict[str, Any]:
        """The dub, whether it is being made, and how far it is or how it ended, in words."""
        running = self._process is not None
        done, count = self._done
        words = f"{done} of {count} stages, {self._words}" if running and count else self._words
        return {"dub": self._dub, "running": running, "words": words}

    def start(self, dub: str) -> None:
        """Make a dub.

        Raises:
            ExplainedError: one is being made.
        """
        with self._lock:
            if self._process is not None:
                raise ExplainedError(f"{self._dub} is being made", remedy="wait, or stop it")
            self._dub, self._words, self._done = dub, "begins", (0, 0)
            pipe, other = CONTEXT.Pipe(duplex=False)
            call = [*self._call, f"--only={dub}"]
            self._process = process(run, self._program, call, other, daemon=True)
            self._process.start()
            other.close()
            Thread(target=self._watch, args=(lines(pipe), self._process), daemon=True).start()

    def stop(self) -> None:
        """End the run, which can go on later; nothing where there is none."""
        with suppress(AttributeError):
            self._process.terminate()

    def _watch(self, printed: Iterable[str], running: Any) -> None:
        failed = ""
        for line in printed:
            try:
                event = json.loads(line)
            except ValueError:  # why it ends
                failed = line.strip() or failed
                continue
            if event["event"] == "overall":
                self._done = event["done"], event["total"]
            elif event["event"] in ("begin", "progress"):
                self._words = f"{event['stage'].split()[0]} {event.get('share', 0):.0%}"
            elif event["event"] == "result":
                lost = [one["failure"] for one in event["jobs"].values() if one["failure"]]
                failed = f"{lost[0]['stage']}: {lost[0]['what']}" if lost else failed
        running.join()
        self._words = ENDS.get(running.exitcode, f"not made: {failed}" if failed else "not made")
        self._process = None


def lines(pipe: Connection) -> Iterator[str]:
    """The lines that are printed at the other end, until it is closed."""
    begun = b""
    with suppress(EOFError, OSError):
        while True:
            *whole, begun = (begun + pipe.recv_bytes()).split(b"\n")
            yield from (line.decode("utf-8", "replace") for line in whole)
    yield begun.decode("utf-8", "replace")
