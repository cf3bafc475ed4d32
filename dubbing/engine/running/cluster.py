"""Stages on other machines, by Dask `distributed`: its workers start a process for each task.

A worker whose interpreter is busy for minutes would be taken for dead, and a process can be killed
without harm. Dask gives what a vanished worker did to another one.
"""

import subprocess
import time
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from pydantic import ConfigDict
from typing_extensions import TypedDict

from ..disk import claims, json_records
from ..environment import of_children, python
from ..errors import CallError, ExplainedError
from ..graph.stage_id import StageId
from .executors import FAILED, KILLED, Done, Program, Task, result
from .outcome import Failure

ANSWER = "15s"  # time that a scheduler has to answer
CLOSING = 5  # seconds that leaving it may take
LOST = "the Dask scheduler is gone"
AGAIN = "start it again, then run again: what was made stays"


class SchedulerFile(TypedDict):
    """The part of a scheduler file that is used."""

    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]

    address: str


def call(module: str, argument: str) -> tuple[int, str, str]:
    """Run a `Program` on a worker: exit code, stdout and stderr of its process."""
    done = subprocess.run(
        [*python(module), argument],
        check=False,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        env=of_children(),
    )
    return done.returncode, done.stdout, done.stderr


class Cluster:
    """The workers of a Dask scheduler.

    Args:
        scheduler: its address, or the file that it has written it to.

    Raises:
        CallError: no scheduler answers.
    """

    here = False

    def __init__(self, program: Program, scheduler: str) -> None:
        from distributed import Client

        remedy = "start one with `dask scheduler`"
        address, self._where = scheduler, scheduler
        try:
            if Path(scheduler).is_file():
                found = json_records.read(Path(scheduler), SchedulerFile, "the scheduler's file")
                address = found["address"]
            self._client = Client(address=address, timeout=ANSWER, set_as_default=False)
        except ExplainedError as error:
            raise CallError(error.what, scheduler, remedy) from error
        except Exception as error:  # whatever Dask makes of an odd address or answer
            raise CallError("no Dask scheduler answers", scheduler, remedy) from error
        self._program = program
        self._futures: dict[StageId, Any] = {}
        self._done: SimpleQueue[tuple[StageId, Any]] = SimpleQueue()

    def submit(self, task: Task) -> None:
        """Take on a task whose needs are met; see `Stage.needs_gpu`: of workers' resource GPU."""
        if self._client.status == "closed":
            raise ExplainedError(LOST, self._where, AGAIN)
        future = self._client.submit(
            call,
            *self._program.call(task),
            key=f"{task.id}-{uuid4().hex[:8]}",
            priority=-task.rank,
            resources={"GPU": 1} if task.stage.needs_gpu() else None,
            pure=False,
        )
        self._futures[task.id] = future
        future.add_done_callback(lambda ended: self._done.put((task.id, ended)))

    def wait(self, seconds: float) -> list[Done]:
        try:
            key, future = self._done.get(timeout=seconds)
        except Empty:
            return self._lost() if self._client.status == "closed" else []
        if key not in self._futures or self._futures[key] is not future:
            return []  # it was dropped
        del self._futures[key]
        if future.status == "finished":
            return [result(key, *future.result())]
        if future.status != "error":
            while self._client.status == "connecting":  # for as long as `ANSWER`
                time.sleep(claims.POLL_S)
            if self._client.status != "running":
                return [Done(key, FAILED, failure=Failure(key.kind, LOST, self._where, AGAIN))]
            return [Done(key, KILLED)]  # the scheduler has lost or cancelled it
        error = future.exception()
        remedy = "see the log of the workers, then run again"
        what = f"its worker could not do it: {type(error).__name__}: {error}"
        return [Done(key, FAILED, failure=Failure(key.kind, what, remedy=remedy))]

    def _lost(self) -> list[Done]:
        """Failures of all tasks that were begun, where Dask has given its scheduler up."""
        failures = {key: Failure(key.kind, LOST, self._where, AGAIN) for key in self._futures}
        self._futures = {}
        return [Done(key, FAILED, failure=failure) for key, failure in failures.items()]

    def drop(self) -> list[StageId]:
        """Forget all that has not ended; gives the stages. Workers finish what they have begun."""
        dropped, futures = [*self._futures], [*self._futures.values()]
        self._futures = {}
        if futures and self._client.status == "running":
            self._client.cancel(futures)
        return dropped

    def close(self) -> None:
        """Leave the cluster as it is."""
        self.drop()
        with suppress(Exception):  # of a scheduler that is gone
            self._client.close(timeout=CLOSING)
