"""Work in other processes, side by side. One that is killed takes no other work with it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from queue import SimpleQueue
from types import TracebackType
from typing import Any


class Processes:
    """So many processes, each started when it is first needed and kept for what comes next.

    A single pool of them all would break as a whole, its waiting work included, when one is killed.
    """

    def __init__(self, count: int) -> None:
        self._threads = ThreadPoolExecutor(count)
        self._idle: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
        for _ in range(count):
            self._idle.put(_process())

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call `work` in a process that is idle, now or later.

        The future raises BrokenProcessPool if that process is killed while it works.
        """
        return self._threads.submit(self._call, work, *arguments)

    def _call(self, work: Callable[..., Any], *arguments: Any) -> Any:
        process = self._idle.get()
        try:
            return process.submit(work, *arguments).result()
        except BrokenProcessPool:
            process.shutdown()
            process = _process()
            raise
        finally:
            self._idle.put(process)

    def __enter__(self) -> Processes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        # Who leaves in a hurry waits for what is being done, not for what would come next.
        self._threads.shutdown(cancel_futures=kind is not None)
        while not self._idle.empty():
            self._idle.get().shutdown()


def _process() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(
        1,
        mp_context=get_context("spawn"),
        initializer=_end_with_parent,
        initargs=(os.getpid(),),
    )


def _end_with_parent(parent: int) -> None:
    """A worker must not go on writing after its parent was killed and the lock is free."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.2)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
