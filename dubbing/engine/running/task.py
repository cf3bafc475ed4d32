"""One stage brought up to date in a process of its own; see `executors.Program`.

The last line on stdout is its outcome, as JSON. Exit code 0: it is up to date; 1: it failed; 75:
another run is at work on it; 130: interrupted.
"""

import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from multiprocessing import parent_process
from typing import Any

from ..disk import json_records
from ..errors import StageError
from ..graph.graph import Job
from ..graph.stage import Stage
from ..graph.stage_id import StageId
from .executors import FAILED, HELD, Call, Done, Task, attempt
from .outcome import failure_of

CODES = {FAILED: 1, HELD: os.EX_TEMPFAIL}
INTERRUPTED = 130
LOOKS = 5  # one a second, until results of another machine are visible here
Find = Callable[..., Job]
Difference = tuple[str, str]  # what differs, and a remedy


def main(argument: str, job_of: Find, known: Mapping[str, Difference] | None = None) -> int:
    """Do the task of one call; gives the exit code.

    Args:
        argument: a `Call` as JSON.
        job_of: makes a job again from its label, and the arguments of the `Program`.
        known: for parameters that depend on the machine: the error where one differs here.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    _end_with_parent()
    printed, sys.stdout = sys.stdout, sys.stderr  # libraries print, too
    try:
        done = _done(argument, job_of, known or {})
    except KeyboardInterrupt:
        return INTERRUPTED
    print(json.dumps(asdict(done)), file=printed, flush=True)
    return CODES.get(done.state, 0)


def _done(argument: str, job_of: Find, known: Mapping[str, Difference]) -> Done:
    call = json_records.parse(argument, Call, "call", "its argument", "let a run make it")
    name = StageId(**call.stage)
    try:
        job = job_of(name.job, *call.arguments)
        if job.blocked:
            raise job.blocked
        stage = job.find(name)
        _expect(stage, call.expected, known)
    except Exception as error:
        return Done(name, FAILED, failure=failure_of(name.kind, error))
    return attempt(Task(0, stage, call.force, {}, _nothing, _nothing))


def _expect(stage: Stage, expected: dict[str, str], known: Mapping[str, Difference]) -> None:
    """Raises StageError where the stage is not the one that the run means.

    A folder over a network may be seen as it was some seconds ago: listing it brings it up to date.
    """
    for _ in range(LOOKS):
        here = stage.fingerprints()
        other = [n for n in {**expected, **here} if expected.get(n) != here.get(n)]
        if not other:
            return
        for source in stage.inputs.values():
            if isinstance(source, Stage):
                with suppress(OSError):
                    os.listdir(source.folder.parent)
        time.sleep(1)
    where = f"{stage.id.kind} on {socket.gethostname()}"
    if len(other) == 1 and other[0] in known:
        what, remedy = known[other[0]]
        raise StageError(f"{what} is another one here, or missing", where, remedy)
    words = {"code": "the code", "files": "a file that it reads"}
    named = ", ".join(known[name][0] if name in known else words.get(name, name) for name in other)
    what = f"not what it was where the run was started: {named}"
    raise StageError(what, where, "run it again")


def _nothing(*_arguments: Any) -> None:
    """Whoever wants to know looks at the claim."""


def _end_with_parent() -> None:
    """A run that was killed does not leave its tasks behind."""
    run, parent = parent_process(), os.getppid()

    def watch() -> None:
        while os.getppid() == parent and (run is None or run.is_alive()):
            time.sleep(0.2)
        os._exit(INTERRUPTED)

    threading.Thread(target=watch, daemon=True).start()
