"""`dfrf dub` of one dub, started and watched from the page."""

from __future__ import annotations

import json
import signal
import subprocess
from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from dubbing.engine.environment import of_children, python
from dubbing.errors import ExplainedError

ENDS = {0: "made", 3: "made; its sync check failed"}
# By exit code; the second where the signal came before it was listened to.
ENDS |= dict.fromkeys((130, -signal.SIGTERM), "stopped; it goes on where it was")


class Making:
    """At most one run at a time, in a process of its own, which another page may have started.

    Args:
        device: auto, cpu or cuda.
        program: a module that is run as `dfrf` is.
    """

    def __init__(self, manifest: Path, device: str, program: str = "dubbing") -> None:
        self._call = (*python(program), "dub", str(manifest), "--device", device)
        self._lock = Lock()
        self._process: subprocess.Popen[str] | None = None
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
            self._process = subprocess.Popen(
                [*self._call, f"--only={dub}", "--json"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env=of_children(),
            )
            Thread(target=self._watch, args=(self._process,), daemon=True).start()

    def stop(self) -> None:
        """End the run, which can go on later; nothing where there is none."""
        with suppress(AttributeError, ProcessLookupError):
            self._process.send_signal(signal.SIGTERM)  # type: ignore[union-attr]

    def _watch(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        failed = ""
        for line in process.stdout:
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
        code = process.wait()
        self._words = ENDS.get(code, f"not made: {failed}" if failed else "not made")
        self._process = None
