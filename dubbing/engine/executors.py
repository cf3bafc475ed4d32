"""Where stages are brought up to date: in this process, or in processes of this machine.

Every executor takes tasks whose needs are met, does those of the lowest rank first, and gives back
what became of them. `dubbing.engine.cluster` has the third, on other machines.
"""

import heapq
import json
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, PriorityQueue, SimpleQueue
from typing import Protocol

from dubbing.engine.graph import kind_of
from dubbing.engine.outcome import Failure, failure_of
from dubbing.engine.stage import Progress, Stage
from dubbing.engine.update import run_stage
from dubbing.environment import of_children, python
from dubbing.errors import LockedError

MADE, KEPT, FAILED, HELD, KILLED = "made", "kept", "failed", "held", "killed"
TASK = "dubbing.engine.task"  # which a process of its own runs
PIPELINE = "dubbing.batch.jobs"  # the module that declares the graph of a manifest again
OUT_OF_MEMORY = 128 + signal.SIGKILL  # exit code of a shell or container whose process was killed


@dataclass(frozen=True, order=True)
class Task:
    """A stage to bring up to date.

    Attributes:
        rank: the lowest goes first.
        key: of its node in the graph.
        began: digests of the files that it goes back to, when the run began.
        begin: called when the work begins, where that is in this process.
    """

    rank: int
    key: str
    stage: Stage = field(compare=False)
    force: bool = field(compare=False)
    began: Mapping[Path, str] = field(compare=False, repr=False)
    begin: Callable[[], None] = field(compare=False, repr=False)
    progress: Progress = field(compare=False, repr=False)


@dataclass(frozen=True)
class Done:
    """What became of a task.

    Attributes:
        state: made, kept (it was up to date), failed, held (another run is at work on it) or
            killed (with its process; it may go better the next time).
    """

    key: str
    state: str
    seconds: float = 0.0
    failure: Failure | None = None


class Executor(Protocol):
    """Does tasks."""

    here: bool  # whether tasks call `begin` and `progress` themselves

    def submit(self, task: Task) -> None:
        """Take on a task whose needs are met."""

    def wait(self, seconds: float) -> list[Done]:
        """What ended, waited for so long at most."""

    def drop(self) -> list[str]:
        """Forget what has not begun; its keys."""

    def close(self) -> None:
        """End what still runs; it goes on there the next time."""


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
        state, failure = FAILED, failure_of(task.stage.name, error)
    return Done(task.key, state, round(time.perf_counter() - started, 2), failure)


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

    def drop(self) -> list[str]:
        dropped, self._waiting = [task.key for task in self._waiting], []
        return dropped

    def close(self) -> None:
        """Nothing runs any more."""


@dataclass(frozen=True)
class Source:
    """Where another process finds the graph again.

    Attributes:
        manifest: as the pipeline takes it.
        device: auto, cpu or cuda.
    """

    manifest: Path
    device: str = "auto"

    def command(self, task: Task) -> list[str]:
        """The arguments of `dubbing.engine.task` for a task."""
        label, _, stage = task.key.rpartition("/")
        more = [*(["--force"] if task.force else []), "--pipeline", PIPELINE]
        more += ["--expect", json.dumps(task.stage.fingerprints()), "--device", self.device]
        return [str(self.manifest), label, stage, *more]


def result(key: str, code: int, out: str, error: str) -> Done:
    """What a process of `dubbing.engine.task` came to, by its exit code and what it printed."""
    stage = kind_of(key)
    if code < 0 or code == OUT_OF_MEMORY:
        return Done(key, KILLED)
    try:
        found = json.loads(out.splitlines()[-1])
        failure = found["failure"] and Failure(**found["failure"])
        return Done(key, found["state"], found["seconds"], failure)
    except (IndexError, KeyError, TypeError, ValueError):
        what = f"its process ended with code {code}"
        failure = Failure(stage, what, "not foreseen", "see the trace; please report it", error)
        return Done(key, FAILED, failure=failure)


class Processes:
    """So many processes of this machine, a fresh one for each task."""

    here = False

    def __init__(self, source: Source, count: int) -> None:
        self._source = source
        self._waiting: PriorityQueue[Task] = PriorityQueue()
        self._done: SimpleQueue[Done] = SimpleQueue()
        self._running: set[subprocess.Popen[str]] = set()
        self._closed = threading.Event()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task) -> None:
        self._waiting.put(task)

    def wait(self, seconds: float) -> list[Done]:
        try:
            return [self._done.get(timeout=seconds)]
        except Empty:
            return []

    def drop(self) -> list[str]:
        dropped = []
        while True:
            try:
                dropped.append(self._waiting.get_nowait().key)
            except Empty:
                return dropped

    def close(self) -> None:
        self._closed.set()
        self.drop()
        for process in [*self._running]:
            process.terminate()
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        while not self._closed.is_set():
            try:
                task = self._waiting.get(timeout=0.1)
            except Empty:
                continue
            try:
                self._done.put(self._run(task))
            except Exception as error:  # for one, no process can be started
                failure = failure_of(task.stage.name, error)
                self._done.put(Done(task.key, FAILED, failure=failure))

    def _run(self, task: Task) -> Done:
        call = [*python(TASK), *self._source.command(task)]
        with subprocess.Popen(
            call,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=of_children(),
        ) as process:
            self._running.add(process)
            if self._closed.is_set():
                process.terminate()
            try:
                out, error = process.communicate()
            finally:
                self._running.discard(process)
        return result(task.key, process.returncode, out, error)
