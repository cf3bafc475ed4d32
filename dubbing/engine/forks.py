"""Processes that begin as forks of one that has loaded what takes long.

Loading torch and OpenCV takes a process two to four seconds, longer than a short line needs.
"""

import gc
import multiprocessing
import os
import sys
from collections.abc import Iterable, Mapping
from typing import Any

# Elsewhere forks are not safe, or there are none: each process loads everything.
CONTEXT: Any = multiprocessing.get_context("forkserver" if sys.platform == "linux" else "spawn")

LOADED: list[str] = []  # names of modules


def load_beforehand(modules: Iterable[str]) -> None:
    """Name modules that are loaded once, when the first process is started, beside those named."""
    LOADED.extend(name for name in modules if name not in LOADED)
    CONTEXT.set_forkserver_preload(LOADED)


def begin(environment: Mapping[str, str]) -> None:
    """The first call in a process; its environment is that of who started it.

    That of the process that it is a fork of may be older.
    """
    os.environ.clear()
    os.environ.update(environment)
    gc.freeze()  # or the collector goes through all that was loaded, for two seconds of a dub
