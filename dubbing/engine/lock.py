"""One run at a time in an output folder."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dubbing.errors import LockedError
from dubbing.files import make_folder


@contextmanager
def hold(work: Path) -> Iterator[None]:
    """Hold the lock on ``work`` (made if need be). The system frees it even after kill -9.

    Raises:
        DubbingError: there can be no such folder.
        LockedError: another run holds it.
    """
    make_folder(work)
    with open(work / ".lock", "a+") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            handle.seek(0)
            holder = handle.read().strip() or "unknown"
            raise LockedError(
                "another run is at work", str(work), f"wait for process {holder}, or end it"
            ) from None
        handle.truncate(0)
        handle.write(f"{os.getpid()}\n")
        handle.flush()
        yield
