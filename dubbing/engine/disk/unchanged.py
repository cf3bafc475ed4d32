"""Keeps findings about files for as long as these do not change."""

import functools
import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from typing_extensions import TypedDict

from ..errors import ExplainedError
from . import json_records
from .files import atomic_write_json, digest_data
from .numbered import numbered, plain

Found = TypeVar("Found")
Known = dict[str, tuple[str, Any]]  # by function and file: digest of its status, and what is found
MOST_KNOWN = 10_000
SETTLED_S = 2.0  # a file that changed later may change again without another time stamp


class Kept(TypedDict):
    """The file that `keep_in` reads and writes."""

    version: str
    known: Known


@dataclass
class Findings:
    """Findings about files beyond this process; None: nothing is kept."""

    known: Known | None = None


FINDINGS = Findings()


def while_unchanged(
    maxsize: int, kept: Any = None
) -> Callable[[Callable[[Path], Found]], Callable[[Path], Found]]:
    """Cache a function of a file until its size, a time stamp or its inode changes.

    Of the time stamps one is the system's own: nobody can put it back. Of a film of numbered files
    each counts.

    The cached function raises FileNotFoundError where there is no file.

    Args:
        maxsize: so many files.
        kept: the type of the results, where `keep_in` keeps them beyond the process.
    """

    def wrap(read: Callable[[Path], Found]) -> Callable[[Path], Found]:
        @functools.lru_cache(maxsize)
        def cached(path: Path, *status: int) -> Found:
            if FINDINGS.known is None or kept is None or not path.is_absolute():
                return read(path)
            return _known_or_read(FINDINGS.known, read, path, status, kept)

        @functools.wraps(read)
        def call(path: Path) -> Found:
            sequence = numbered(path)
            status: list[int] = []
            for file in (sequence.files().values() if sequence else ()) or (plain(path),):
                of = os.stat(file)
                status += (of.st_size, of.st_mtime_ns, of.st_ctime_ns, of.st_ino)
            return cached(path, *status)

        return call

    return wrap


def keep_in(file: Path, version: str) -> None:
    """Read what earlier processes kept in a file, and add to it at the end what this one finds.

    Args:
        version: of the code; what another version found is forgotten.
    """
    if FINDINGS.known is None:
        kept = json_records.read_or(None, file, Kept)
        FINDINGS.known = known = kept["known"] if kept and kept["version"] == version else {}
        last = next(reversed(known.items()), None)
        # Unlike `atexit`, at the end of a process of multiprocessing, too.
        Finalize(None, _keep, (known, file, version, last), exitpriority=0)


def _keep(known: Known, file: Path, version: str, last: tuple[str, Any] | None) -> None:
    if known and next(reversed(known.items())) != last:
        with suppress(OSError, ExplainedError):  # it saves time alone
            file.parent.mkdir(parents=True, exist_ok=True)
            newest = dict(list(known.items())[-MOST_KNOWN:])
            atomic_write_json(file, {"version": version, "known": newest})


def _known_or_read(
    known: Known, read: Callable[[Path], Found], path: Path, status: tuple[int, ...], shape: Any
) -> Found:
    name, state = f"{read.__module__}.{read.__qualname__} {path}", digest_data(status)
    adapter: TypeAdapter[Found] = json_records.adapter(shape)
    if name in known and known[name][0] == state:
        with suppress(ValidationError):
            return adapter.validate_python(known[name][1])
    found = read(path)
    if max(status[2::4]) < time.time_ns() - SETTLED_S * 1e9:
        known.pop(name, None)
        known[name] = (state, adapter.dump_python(found, mode="json"))
    return found
