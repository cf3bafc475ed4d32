"""One run at a time in an output folder."""

from __future__ import annotations

import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dubbing.errors import DubbingError, LockedError
from dubbing.files import make_folder, writing

FILE = ".lock"


@contextmanager
def hold(work: Path) -> Iterator[None]:
    """Hold the lock on ``work`` (made if need be). The system frees it even after kill -9.

    Raises:
        DubbingError: there can be no such folder, or no lock in it.
        LockedError: another run holds it.
    """
    make_folder(work)
    handle = _opened(work / FILE)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(handle, 20).strip()
            name = holder.decode() if holder.isdigit() else "unknown"
            raise LockedError(
                "another run is at work", str(work), f"wait for process {name}, or end it"
            ) from None
        with suppress(OSError):  # a full disk: the lock holds without a name in it
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(handle)


def _opened(path: Path) -> int:
    """The lock's file, which is no link, no pipe and no other name of some file."""
    remedy = "it is none of ours: remove it, then run again"
    if path.is_symlink():
        raise DubbingError("the lock is a link", str(path), remedy)
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    with writing(path):
        handle = os.open(path, flags, 0o666)
    found = os.fstat(handle)
    if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
        os.close(handle)
        raise DubbingError("the lock is another file", str(path), remedy)
    return handle
