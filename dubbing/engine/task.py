"""One stage of a manifest brought up to date, in a process of its own.

    python -m dubbing.engine.task MANIFEST JOB STAGE

JOB is ``identity/NAME`` or ``dub/NAME``; STAGE is what it calls the stage, as ``render`` or
``render host_0000010-0000050``. The last line on stdout is its result, as JSON.
Exit code 0: it is up to date; 1: it failed; 75: another run is at work on it.
"""

import argparse
import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

from dubbing.engine.executors import FAILED, HELD, PIPELINE, Done, Task, attempt
from dubbing.engine.graph import Job, kind_of
from dubbing.engine.outcome import failure_of
from dubbing.engine.stage import Stage
from dubbing.errors import StageError

CODES = {FAILED: 1, HELD: os.EX_TEMPFAIL}
INTERRUPTED = 130
KEY = "the key of the invisible mark"
SHARE_KEY = (
    "copy mark.key from the settings folder of where the run was started into the one here, or "
    "name a key in the manifest, `mark: {key: FILE}`; see docs/cluster.md"
)
WORDS = {"code": "the code", "files": "a file that it reads", "mark": KEY}
LOOKS = 5  # one a second, until results of another machine are seen here


def main() -> int:
    """Does one task; gives the exit code."""
    parser = argparse.ArgumentParser(description="Bring one stage of a manifest up to date.")
    parser.add_argument("manifest", type=Path)
    parser.add_argument("job", help="identity/NAME or dub/NAME")
    parser.add_argument("stage", help="by its name in the job")
    parser.add_argument("--device", default="auto", help="auto, cpu or cuda")
    parser.add_argument("--force", action="store_true", help="do it again")
    parser.add_argument("--expect", help="the stage's fingerprints where the run was started")
    parser.add_argument("--pipeline", default=PIPELINE, help="module that declares the stages")
    chosen = parser.parse_args()
    signal.signal(signal.SIGTERM, _interrupt)
    _end_with_parent()
    printed, sys.stdout = sys.stdout, sys.stderr  # libraries print, too
    try:
        done = _done(chosen)
    except KeyboardInterrupt:
        return INTERRUPTED
    print(json.dumps(asdict(done)), file=printed, flush=True)
    return CODES.get(done.state, 0)


def _done(chosen: argparse.Namespace) -> Done:
    key = f"{chosen.job}/{chosen.stage}"
    try:
        job_of: Callable[[Path, str, str], Job] = import_module(chosen.pipeline).job_of
        job = job_of(chosen.manifest, chosen.job, chosen.device)
        if job.blocked:
            raise job.blocked
        stage = job.stage(chosen.stage)
        if chosen.expect:
            _expect(stage, json.loads(chosen.expect))
    except Exception as error:
        return Done(key, FAILED, failure=failure_of(kind_of(key), error))
    return attempt(Task(0, key, stage, chosen.force, {}, _nothing, _nothing))


def _expect(stage: Stage, fingerprints: dict[str, str]) -> None:
    """Raises StageError where the stage is not the one that the run means.

    A folder over a network may be seen as it was some seconds ago: listing it brings it up to date.
    """
    for _ in range(LOOKS):
        here = stage.fingerprints()
        other = [n for n in {**fingerprints, **here} if fingerprints.get(n) != here.get(n)]
        if not other:
            return
        for source in stage.inputs.values():
            if isinstance(source, Stage):
                with suppress(OSError):
                    os.listdir(source.folder.parent)
        time.sleep(1)
    where = f"{stage.name} on {socket.gethostname()}"
    if other == ["mark"]:
        raise StageError(f"{KEY} is another one here, or missing", where, SHARE_KEY)
    named = ", ".join(WORDS.get(name, name) for name in other)
    what = f"not what it was where the run was started: {named}"
    raise StageError(what, where, "run it again")


def _nothing(*_arguments: Any) -> None:
    """Who wants to know looks at the claim."""


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _end_with_parent() -> None:
    """A run that was killed does not leave its tasks behind."""
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.2)
        os._exit(INTERRUPTED)

    threading.Thread(target=watch, daemon=True).start()


if __name__ == "__main__":
    sys.exit(main())
