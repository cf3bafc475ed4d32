"""Processes that begin as forks of one that has loaded what takes long.

Loading torch and OpenCV takes a process two to four seconds, longer than a short line needs.
"""

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from .environment import of_children

# Elsewhere forks are not safe, or there are none: each process loads everything.
CONTEXT: Any = multiprocessing.get_context("forkserver" if sys.platform == "linux" else "spawn")

NAMED: list[str] = []


def load_beforehand(modules: Iterable[str]) -> None:
    """Name modules that are loaded once, when the first process is started, beside those named."""
    NAMED.extend(name for name in modules if name not in NAMED)
    CONTEXT.set_forkserver_preload(NAMED)


def process(target: Callable[..., object], *arguments: Any, daemon: bool = False) -> Any:
    """A process that calls a function; it is not started yet.

    Its environment is that of now. That of the process that it is a fork of may be older.
    """
    call = of_children(), target, *arguments
    return CONTEXT.Process(target=_begin, args=call, daemon=daemon)


def _begin(environment: Mapping[str, str], target: Callable[..., object], *arguments: Any) -> None:
    os.environ.clear()
    os.environ.update(environment)
    target(*arguments)
