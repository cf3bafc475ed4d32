"""Processes frames on several threads.

Threads and not processes: torch, OpenCV and numpy release the interpreter's lock.
"""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from dfrf.ordered import ordered

MOST_THREADS = 8


def in_order(work: Callable[..., Any], jobs: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
    """Results of work(*job) in the order of the jobs, computed by threads, with few in flight."""
    threads = max(1, min(MOST_THREADS, os.cpu_count() or 1))
    with ThreadPoolExecutor(threads) as pool:
        yield from ordered(pool, lambda job: work(*job), jobs, ahead=2 * threads - 1)
