"""Threads that work in parallel, each with operations of its own.

On a CPU one operation spread over two cores gains little: its parts are milliseconds long and wait
for one another. Two operations on one core each gain nearly a factor of two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import Self, TypeVar

import torch

from dfrf.ordered import ordered

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers(ExitStack):
    """A pool of threads that split the cores among them; no threads on a GPU.

    Args:
        device: where the work is done.
        most: largest number of threads.
    """

    def __init__(self, device: torch.device, most: int) -> None:
        super().__init__()
        cores = torch.get_num_threads() if device.type == "cpu" else 1
        self.count = min(most, cores)
        self._each = cores // self.count
        self._pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> Self:
        if self.count > 1:
            pool = ThreadPoolExecutor(self.count, "dfrf", torch.set_num_threads, (self._each,))
            self._pool = self.enter_context(pool)
        return self

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Results in the order of the items; each thread works at most one item ahead.

        Gradients are kept as in the calling thread. Torch's `no_grad` holds for one thread: without
        this, every result would keep all activations that it was made from.
        """
        if self._pool is None:
            yield from map(work, items)
            return
        learns = torch.is_grad_enabled()

        def as_called(item: Item) -> Result:
            with torch.set_grad_enabled(learns):
                return work(item)

        yield from ordered(self._pool, as_called, items, ahead=self.count)
