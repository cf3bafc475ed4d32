"""Stages in processes of this machine."""

import os
import sys
import tempfile
import threading
from importlib import import_module
from pathlib import Path
from queue import Empty, PriorityQueue, SimpleQueue
from typing import Any

from .. import forks
from ..graph.stage_id import StageId
from .executors import FAILED, Done, Program, Task, result
from .outcome import failure_of


def run_captured(module: str, argument: str, out: str, error: str) -> None:
    """Run a `Program` in the process that was started for it; what it prints goes to files."""
    for stream, path in ((1, out), (2, error)):
        os.dup2(os.open(path, os.O_WRONLY), stream)
    sys.exit(import_module(module).main(argument))


class Processes:
    """So many processes of this machine, a fresh one for each task."""

    here = False

    def __init__(self, program: Program, count: int) -> None:
        self._program = program
        self._waiting: PriorityQueue[Task] = PriorityQueue()
        self._done: SimpleQueue[Done] = SimpleQueue()
        self._running: set[Any] = set()
        self._closed = threading.Event()
        forks.load_beforehand((program.module, *program.loads))
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

    def drop(self) -> list[StageId]:
        dropped = []
        while True:
            try:
                dropped.append(self._waiting.get_nowait().id)
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
                failure = failure_of(task.id.kind, error)
                self._done.put(Done(task.id, FAILED, failure=failure))

    def _run(self, task: Task) -> Done:
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder, name) for name in ("out", "error")]
            for file in files:
                file.touch()
            process = forks.process(run_captured, *self._program.call(task), *map(str, files))
            process.start()
            self._running.add(process)
            if self._closed.is_set():
                process.terminate()
            try:
                process.join()
            finally:
                self._running.discard(process)
            out, error = (file.read_text(errors="replace") for file in files)
        return result(task.id, process.exitcode, out, error)
