"""A network of MediaPipe, which calls them solutions, that keeps its notes to itself.

MediaPipe writes several lines about its own insides past Python to the terminal at every start, and
has no setting to be silent.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from dubbing.errors import CallError

NOTHING = np.zeros((64, 64, 3), np.uint8)
_LOCK = threading.Lock()
PLOTS = ("matplotlib", "matplotlib.pyplot")  # MediaPipe imports it, and draws nothing with it here
# Where MediaPipe looks for its networks before its own folder.
SOUGHT_HERE = ("mediapipe/modules", "bazel-bin/mediapipe/modules")


@contextmanager
def without_native_messages() -> Iterator[None]:
    """Drops whatever the process writes to its standard error; exceptions pass as ever.

    One thread at a time: the descriptor is the whole process's.
    """
    with _LOCK:
        sys.stderr.flush()
        kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        try:
            yield
        finally:
            sys.stderr.flush()
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)


def solution(name: str) -> ModuleType:
    """A module of MediaPipe's solutions.

    It is imported without matplotlib, which reads a file `matplotlibrc` of the current folder.
    """
    absent = [] if PLOTS[0] in sys.modules else PLOTS
    sys.modules.update({plots: ModuleType(plots) for plots in absent})
    try:
        return import_module(f"mediapipe.python.solutions.{name}")
    finally:
        for plots in absent:
            del sys.modules[plots]


def check_current_folder() -> None:
    """Raises CallError where MediaPipe would take networks of the current folder for its own."""
    for name in SOUGHT_HERE:
        if os.path.lexists(name):
            what = "the face tracker would take its networks from it"
            raise CallError(what, str(Path(name).absolute()), "call from another folder")


class Solution:
    """A solution that is begun by `make`, as `partial(face_mesh.FaceMesh, max_num_faces=1)`."""

    def __init__(self, make: Callable[[], Any]) -> None:
        check_current_folder()
        with without_native_messages():
            self._network = make()
            # Its parts start side by side and report when they like; all have by the first answer.
            self._network.process(NOTHING)
        self._silent = False

    def process(self, image: np.ndarray) -> Any:
        """What it finds in an RGB image (H, W, 3) uint8.

        Some of its parts report once more when something is found first.
        """
        with nullcontext() if self._silent else without_native_messages():
            result = self._network.process(np.ascontiguousarray(image))
        self._silent = self._silent or any(getattr(result, f) is not None for f in result._fields)
        return result

    def close(self) -> None:
        self._network.close()
