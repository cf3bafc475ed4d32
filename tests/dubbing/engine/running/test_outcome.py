"""Errors as people are shown them: memory that runs short has a name and a remedy."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from dubbing.engine.errors import ExplainedError
from dubbing.engine.running.outcome import failure_of

SHORT = [
    MemoryError(),
    np._core._exceptions._ArrayMemoryError((9,), np.dtype(float)),  # type: ignore[attr-defined]
    OSError(errno.ENOMEM, "Cannot allocate memory"),
    RuntimeError(
        "[enforce fail at alloc_cpu.cpp:127] . DefaultCPUAllocator: can't allocate memory"
    ),
    RuntimeError("CUDA out of memory. Tried to allocate 2.00 GiB"),
    RuntimeError("std::bad_alloc"),
    RuntimeError("can't start new thread"),
    Exception(
        "OpenCV(4.14) alloc.cpp:73: error: (-4:Insufficient memory) Failed to allocate 9 bytes"
    ),
]


@pytest.mark.parametrize("error", SHORT, ids=str)
def test_memory_that_runs_short(error: Exception) -> None:
    failure = failure_of("render", error)
    assert failure.what == "memory ran short"
    assert "fewer --jobs" in failure.remedy
    assert failure.trace


def test_other_errors_are_not_taken_for_it() -> None:
    assert failure_of("render", ValueError("odd")).where == "not foreseen"
    refused = failure_of("render", OSError(errno.ENOSPC, "No space left on device", "x"))
    assert "free some space" in refused.remedy
    known = ExplainedError("no face found", "a.mp4", "film the face")
    assert failure_of("prepare", known).what == "no face found"
