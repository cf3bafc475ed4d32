"""Writing files whole or not at all (write, fsync, rename), reading them, and their digests."""

import codecs
import errno
import hashlib
import json
import os
import re
import stat
import time
import unicodedata
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..errors import ExplainedError

WINDOWS = os.name == "nt"
PAUSES_S = (0.1, 0.2, 0.4, 0.8)
FULL = (errno.ENOSPC, errno.EDQUOT)
# A name of a file and what `atomic_path` adds to it must fit into this, in bytes of UTF-8.
LONGEST_NAME = 255 - len("..4194304.tmp")
PARTIAL = ".partial-"  # in the name of a folder of work in progress, before 12 digits of its key
IN_PROGRESS = re.compile(rf".+{re.escape(PARTIAL)}[0-9a-f]{{12}}")
CHECKSUMS = ".checksums"  # in that folder: of each file that is whole, so that damage is seen


def make_folder(path: Path) -> None:
    """Make a folder for results, if need be.

    Raises:
        ExplainedError: it cannot be made, or nothing can be written there.
    """
    remedy = "choose another folder"
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = f"the folder cannot be made: {error.strerror}"
        raise ExplainedError(what, str(path), remedy) from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise ExplainedError("nothing may be written there", str(path), remedy)


def system_error(error: OSError, path: Path | str = "") -> ExplainedError:
    """An error of the system, with its place and a remedy.

    Args:
        path: the file or folder; by default the one that the error names.
    """
    if isinstance(error, IsADirectoryError):
        return ExplainedError("a folder lies where a file should go", str(path), "move it away")
    remedy = "see whether the disk and the rights to it are as they should be, then run again"
    if WINDOWS and isinstance(error, PermissionError):
        remedy = "close the programs that have it open, then run again"
    if error.errno in FULL:
        remedy = "free some space, then run again"
    return ExplainedError(error.strerror or str(error), str(path or error.filename or ""), remedy)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError in the body into a ExplainedError about ``path``."""
    try:
        yield
    except OSError as error:
        raise system_error(error, path) from error


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary name beside ``path`` to write to; on success it becomes ``path``.

    The suffix is kept, so that ffmpeg still recognises the format. On an error the temporary
    file is removed and an older ``path`` stays as it was.

    Raises:
        ExplainedError: it cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.tmp{path.suffix}")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield temporary
        with writing(path):
            sync_file(temporary)
            note_checksum(path, temporary)
            patiently(lambda: os.replace(temporary, path))
            sync_file(path.parent)
    finally:
        with suppress(OSError):
            temporary.unlink()


def note_checksum(path: Path, temporary: Path | None = None) -> None:
    """Keep the checksum of a file that is whole, where it is work in progress.

    Behind that of the file before it: a kill may come before that is replaced.

    Args:
        temporary: the file that is to become ``path``; ``path`` itself by default.
    """
    folder = next((one for one in path.parents if IN_PROGRESS.fullmatch(one.name)), None)
    if folder is None:
        return
    kept = folder / CHECKSUMS / path.relative_to(folder)
    kept.parent.mkdir(parents=True, exist_ok=True)
    before = kept.read_text().split()[-1:] if kept.exists() else []
    kept.write_text(" ".join([*before, checksum_of(temporary or path)]))


def remove_damaged(folder: Path) -> list[Path]:
    """Remove the files of work in progress that are not what was written; gives them."""
    damaged = []
    for kept in (folder / CHECKSUMS).rglob("*"):
        path = folder / kept.relative_to(folder / CHECKSUMS)
        if kept.is_file() and path.is_file() and checksum_of(path) not in kept.read_text().split():
            path.unlink()
            damaged.append(path)
    return damaged


def remove_torn(path: Path) -> None:
    """Remove what an `atomic_path` of ``path`` left behind when its process was killed."""
    torn = re.compile(rf"\.{re.escape(path.stem)}\.\d+\.tmp{re.escape(path.suffix)}")
    with writing(path):
        for other in path.parent.iterdir():
            if torn.fullmatch(other.name):
                other.unlink()


def atomic_write_bytes(path: Path, content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with atomic_path(path) as temporary, writing(path):
        temporary.write_bytes(content)


def atomic_write_text(path: Path, content: str) -> None:
    """Write ``content`` to ``path`` as UTF-8, whole or not at all."""
    # A half character, as names that are no UTF-8 give, is written as JSON does.
    atomic_write_bytes(path, content.encode(errors="backslashreplace"))


def atomic_write_json(path: Path, content: Any) -> None:
    """Write ``content`` to ``path`` as indented JSON, whole or not at all."""
    atomic_write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def read_bounded(path: Path, most: int) -> bytes:
    """Content of a regular file of at most ``most`` bytes.

    Raises:
        OSError: it cannot be opened or read.
        ExplainedError: it is a device, a pipe or a folder, or larger.
    """
    # A pipe that nobody writes to would be waited for.
    own = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # each system has one of them
    handle = os.open(path, os.O_RDONLY | own)
    if not stat.S_ISREG(mode := os.fstat(handle).st_mode):
        os.close(handle)
        what = "it is a folder" if stat.S_ISDIR(mode) else "it is no regular file"
        raise ExplainedError(what, str(path), "name a file")
    with os.fdopen(handle, "rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        what = f"it is larger than {most // 10**6} MB"
        raise ExplainedError(what, str(path), "name another file")
    return content


def read_text(path: Path, most: int) -> str:
    """The same as text, without a byte order mark. UTF-16 needs one; spreadsheets write it.

    Raises:
        OSError, ExplainedError: as `read_bounded`; or it is not UTF-8.
    """
    data = read_bounded(path, most)
    marked = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return data.decode("utf-16" if marked else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ExplainedError("it is not UTF-8", str(path), "save it as UTF-8") from error


def same_on_disk(name: str) -> str:
    """The same for names that are one file where capitals, or forms of letters, do not count."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def patiently(action: Callable[[], object]) -> None:
    """Do what Windows refuses for as long as anybody, such as a virus scanner, has the file open.

    Raises:
        PermissionError: it still does after all `PAUSES_S`.
    """
    for pause in PAUSES_S if WINDOWS else ():
        try:
            action()
            return
        except PermissionError:
            time.sleep(pause)
    action()


def seen_from(folder: Path, path: Path) -> str:
    """The way from a folder to a path, with slashes; the whole path on another drive of Windows."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return path.as_posix()


def sync_file(path: Path) -> None:
    """Push a file (or a folder's list of names) to the disk."""
    if WINDOWS and path.is_dir():
        return  # it opens no folders
    # Windows flushes only what may be written to.
    handle = os.open(path, os.O_RDWR if WINDOWS else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def digest_file(path: Path) -> str:
    """BLAKE2b-128 of a file's bytes, in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def checksum_of(path: Path) -> str:
    """CRC-32 of a file's bytes, in hexadecimal: it tells damage in a fifth of a digest's time."""
    checksum = 0
    with open(path, "rb") as stream:
        while content := stream.read(1 << 20):
            checksum = zlib.crc32(content, checksum)
    return f"{checksum:08x}"


def digest_bytes(content: bytes) -> str:
    """BLAKE2b-128 of bytes, as `digest_file` of a file that holds them."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def digest_data(content: Any) -> str:
    """BLAKE2b-128 of plain data (as JSON holds it), the same for every order of keys."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return digest_bytes(text.encode())
