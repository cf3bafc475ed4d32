"""A network of MediaPipe, which calls them solutions, without its messages.

MediaPipe writes several lines to the terminal at every start, past Python, and has no setting to
be silent.
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

BLANK = np.zeros((64, 64, 3), np.uint8)
_LOCK = threading.Lock()
PLOTS = ("matplotlib", "matplotlib.pyplot")  # MediaPipe imports it, and draws nothing with it here
# Folders of the current folder where MediaPipe looks for its networks before its own.
LOCAL_MODULES = ("mediapipe/modules", "bazel-bin/mediapipe/modules")


@contextmanager
def without_native_messages() -> Iterator[None]:
    """Drops everything that the process writes to its standard error; exceptions pass.

    One thread at a time: the descriptor belongs to the whole process.
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
    """Raises CallError where MediaPipe would load networks from the current folder."""
    for name in LOCAL_MODULES:
        if os.path.lexists(name):
            what = "the face tracker would take its networks from it"
            raise CallError(what, str(Path(name).absolute()), "call from another folder")


class Solution:
    """A solution that `make` starts, as `partial(face_mesh.FaceMesh, max_num_faces=1)`."""

    def __init__(self, make: Callable[[], Any]) -> None:
        check_current_folder()
        with without_native_messages():
            self._network = make()
            # Its parts start in parallel and write at any time; by the first answer all have.
            self._network.process(BLANK)
        self._silent = False

    def process(self, image: np.ndarray) -> Any:
        """The network's result for an RGB image (H, W, 3) uint8.

        Some of its parts write once more at the first detection.
        """
        with nullcontext() if self._silent else without_native_messages():
            result = self._network.process(np.ascontiguousarray(image))
        self._silent = self._silent or any(getattr(result, f) is not None for f in result._fields)
        return result

    def close(self) -> None:
        self._network.close()
