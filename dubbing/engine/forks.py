"""Processes that begin as forks of one that has loaded what takes long.

Loading torch and OpenCV takes a process two to four seconds, longer than a short line needs.
"""

import multiprocessing
import os
import sys
from collections.abc import Iterable, Mapping
from typing import Any

# Elsewhere forks are not safe, or there are none: each process loads everything.
CONTEXT: Any = multiprocessing.get_context("forkserver" if sys.platform == "linux" else "spawn")


def load_beforehand(modules: Iterable[str]) -> None:
    """Name the modules that are loaded once; before the first process is started."""
    CONTEXT.set_forkserver_preload([*modules])


def take(environment: Mapping[str, str]) -> None:
    """Take on the environment of who started this process; that of a fork may be older."""
    os.environ.clear()
    os.environ.update(environment)
