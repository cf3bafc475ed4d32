"""Executors: they bring stages up to date. `InLine` does it in this process.

Every executor takes tasks whose needs are met, does those of the lowest rank first, and gives back
their outcomes. `processes` has the one of this machine's processes, `cluster` that of others.
"""

import heapq
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Protocol

from ..errors import LockedError
from ..graph.stage import Progress, Stage
from ..graph.stage_id import StageId
from .outcome import Failure, failure_of
from .update import run_stage

MADE, KEPT, FAILED, HELD, KILLED = "made", "kept", "failed", "held", "killed"
OUT_OF_MEMORY = 128 + 9  # exit code of a shell or container whose process was killed


@dataclass(frozen=True, order=True)
class Task:
    """A stage to bring up to date.

    Attributes:
        rank: the lowest goes first.
        began: digests of the files that it goes back to, when the run began.
        begin: called when the work begins, where that is in this process.
    """

    rank: int
    stage: Stage = field(compare=False)
    force: bool = field(compare=False)
    began: Mapping[Path, str] = field(compare=False, repr=False)
    begin: Callable[[], None] = field(compare=False, repr=False)
    progress: Progress = field(compare=False, repr=False)

    @property
    def id(self) -> StageId:
        """Names its stage."""
        return self.stage.id


@dataclass(frozen=True)
class Done:
    """The outcome of a task.

    Attributes:
        state: made, kept (it was up to date), failed, held (another run is at work on it) or
            killed (with its process; it may go better the next time).
    """

    id: StageId
    state: str
    seconds: float = 0.0
    failure: Failure | None = None


class Executor(Protocol):
    """Does tasks."""

    here: bool  # whether tasks call `begin` and `progress` themselves

    def submit(self, task: Task) -> None:
        """Take on a task whose needs are met."""

    def wait(self, seconds: float) -> list[Done]:
        """Tasks that ended; waits for so long at most."""

    def drop(self) -> list[StageId]:
        """Forget the tasks that have not begun; gives their stages."""

    def close(self) -> None:
        """End the tasks that still run; the next run continues them."""


def attempt(task: Task) -> Done:
    """Bring a stage up to date in this process; an error becomes a failure."""
    started = time.perf_counter()
    state, failure = KEPT, None
    try:
        if run_stage(task.stage, task.progress, force=task.force, began=task.began, wait=False):
            state = MADE
    except LockedError:
        state = HELD
    except Exception as error:  # whatever a library raises at odd data: its trace is kept
        state, failure = FAILED, failure_of(task.id.kind, error)
    return Done(task.id, state, round(time.perf_counter() - started, 2), failure)


class InLine:
    """One task after another, in this process."""

    here = True

    def __init__(self) -> None:
        self._waiting: list[Task] = []

    def submit(self, task: Task) -> None:
        heapq.heappush(self._waiting, task)

    def wait(self, seconds: float) -> list[Done]:
        """Do the next task, however long it takes."""
        if not self._waiting:
            time.sleep(seconds)
            return []
        task = heapq.heappop(self._waiting)
        task.begin()
        return [attempt(task)]

    def drop(self) -> list[StageId]:
        dropped, self._waiting = [task.id for task in self._waiting], []
        return dropped

    def close(self) -> None:
        """Nothing runs any more."""


@dataclass(frozen=True)
class Program:
    """The program that does one task in a process of its own.

    Attributes:
        module: that Python runs; its `main` takes a `Call` as JSON and calls `task.main`.
        arguments: plain data from which it makes the jobs again.
        loads: modules that tasks need and that take long to load.
    """

    module: str
    arguments: tuple[str, ...]
    loads: tuple[str, ...] = ()

    def call(self, task: Task) -> list[str]:
        """Module and argument of a process that does a task."""
        expected = task.stage.fingerprints()
        call = Call(self.arguments, asdict(task.id), task.force, expected)
        return [self.module, json.dumps(asdict(call))]


@dataclass(frozen=True)
class Call:
    """The argument of a `Program`, written as JSON.

    Attributes:
        arguments: see `Program`.
        stage: fields of a `StageId`.
        force: do it again.
        expected: the stage's fingerprints where the run was started.
    """

    arguments: tuple[str, ...]
    stage: dict[str, str]
    force: bool
    expected: dict[str, str]


def result(stage: StageId, code: int, out: str, error: str) -> Done:
    """The outcome of a process of a `Program`, from its exit code and its output."""
    if code < 0 or code == OUT_OF_MEMORY:
        return Done(stage, KILLED)
    try:
        told = json.loads(out.splitlines()[-1])
        failure = told["failure"] and Failure(**told["failure"])
        return Done(stage, told["state"], told["seconds"], failure)
    except (IndexError, KeyError, TypeError, ValueError):
        what = f"its process ended with code {code}"
        failure = Failure(
            stage.kind, what, "not foreseen", "see the trace; please report it", error
        )
        return Done(stage, FAILED, failure=failure)
