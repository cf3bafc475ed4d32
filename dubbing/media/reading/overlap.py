"""Overlaps decoding and encoding with the work in between: one thread at each end of a queue."""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

Item = TypeVar("Item")
_END: Any = object()
DEPTH = 4  # largest number of waiting items: memory does not grow with the length


def ahead(items: Iterable[Item], depth: int = DEPTH) -> Generator[Item]:
    """The same items, fetched up to ``depth`` ahead. Errors are raised in place of their item."""
    iterator = iter(items)
    with ThreadPoolExecutor(1) as pool:
        waiting: deque[Future[Item]] = deque()
        try:
            waiting.extend(pool.submit(next, iterator, _END) for _ in range(depth))
            while (item := waiting.popleft().result()) is not _END:
                waiting.append(pool.submit(next, iterator, _END))
                yield item
        finally:
            pool.shutdown(cancel_futures=True)
            if isinstance(iterator, Generator):
                iterator.close()


@contextmanager
def behind(write: Callable[[Item], None]) -> Iterator[Callable[[Item], None]]:
    """A function that queues items for ``write``; leaving the block waits for all of them."""
    with ThreadPoolExecutor(1) as pool:
        waiting: deque[Future[None]] = deque()

        def queue(item: Item) -> None:
            while len(waiting) >= DEPTH:
                waiting.popleft().result()
            waiting.append(pool.submit(write, item))

        try:
            yield queue
            while waiting:
                waiting.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)
