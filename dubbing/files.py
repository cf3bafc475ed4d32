"""Files that appear whole or not at all (write, fsync, rename), what they hold (digests), and the
folders they go to.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dubbing.errors import DubbingError

BLOCK = 1 << 20  # bytes read at a time


def make_folder(path: Path) -> None:
    """Make a folder for results, if need be.

    Raises:
        DubbingError: it cannot be made, or nothing can be written there.
    """
    remedy = "choose another folder"
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = f"the folder cannot be made: {error.strerror}"
        raise DubbingError(what, str(path), remedy) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise DubbingError("nothing may be written there", str(path), remedy)


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary name beside ``path`` to write to; on success it becomes ``path``.

    The suffix is kept, so that ffmpeg still recognises the format. On an error the temporary
    file is removed and an older ``path`` stays as it was.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    try:
        yield temporary
        sync_file(temporary)
        os.replace(temporary, path)
        sync_file(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def atomic_write_bytes(path: Path, content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def atomic_write_text(path: Path, content: str) -> None:
    """Write ``content`` to ``path`` as UTF-8, whole or not at all."""
    atomic_write_bytes(path, content.encode())


def atomic_write_json(path: Path, content: Any) -> None:
    """Write ``content`` to ``path`` as indented JSON, whole or not at all."""
    atomic_write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def sync_file(path: Path) -> None:
    """Push a file (or a folder's list of names) to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def digest_file(path: Path) -> str:
    """BLAKE2b-128 of a file's bytes, in hexadecimal."""
    hasher = hashlib.blake2b(digest_size=16)
    with open(path, "rb") as stream:
        while block := stream.read(BLOCK):
            hasher.update(block)
    return hasher.hexdigest()


def digest_data(content: Any) -> str:
    """BLAKE2b-128 of plain data (what JSON can say), the same for every order of keys."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
