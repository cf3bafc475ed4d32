"""The server's end of the process that draws frames; see `drafting`."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncGenerator, Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from dubbing.engine.forks import CONTEXT, process
from dubbing.errors import ExplainedError
from dubbing.studio.drafting import Answer, Job, serve

GONE = Answer(0, ended=True, error="the process that draws ended; it starts again when asked")


class Drafter:
    """Asks a process of its own, which is started when it is first needed.

    Args:
        target: that runs in it.
    """

    def __init__(
        self, manifest: Path, device: str = "auto", target: Callable[..., None] = serve
    ) -> None:
        self.call = (str(manifest), device)
        self.target = target
        self._numbers = itertools.count(1)
        self._asked: dict[int, Callable[[Answer], object]] = {}
        self._lock = Lock()
        self._process: Any = None
        self._pipe: Connection

    async def ask(self, ask: str, dub: str, **arguments: Any) -> AsyncGenerator[Any]:
        """Yields the values that a job gives; leaving off early takes it back.

        Raises:
            ExplainedError: it could not be done.
        """
        queue: asyncio.Queue[Answer] = asyncio.Queue()
        loop = asyncio.get_running_loop()
        job = Job(next(self._numbers), ask, dub, arguments)
        answer = Answer(job.number)
        try:
            self._send(job, lambda one: loop.call_soon_threadsafe(queue.put_nowait, one))
            while not (answer := await queue.get()).ended:
                yield answer.value
        finally:
            self._asked.pop(job.number, None)
            if not answer.ended:
                self._take_back(job.number)
        if answer.error:
            raise ExplainedError(answer.error)

    def close(self) -> None:
        """End the process."""
        with self._lock:
            if self._process is not None:
                self._process.terminate()
                self._process.join()
                self._process = None

    def _send(self, job: Job, deliver: Callable[[Answer], object]) -> None:
        with self._lock:
            if self._process is None or not self._process.is_alive():
                self._pipe, other = CONTEXT.Pipe()
                self._process = process(self.target, other, *self.call, daemon=True)
                self._process.start()
                other.close()
                Thread(target=self._receive, args=(self._pipe,), daemon=True).start()
            self._asked[job.number] = deliver
            self._pipe.send(job)

    def _take_back(self, number: int) -> None:
        with self._lock:
            if self._process is not None and self._process.is_alive():
                self._pipe.send(number)

    def _receive(self, pipe: Connection) -> None:
        """Hand answers on until the process ends, and its end then."""
        with pipe, suppress(EOFError, OSError):
            while True:
                answer = pipe.recv()
                if deliver := self._asked.get(answer.number):
                    deliver(answer)
        for deliver in list(self._asked.values()):
            deliver(GONE)
