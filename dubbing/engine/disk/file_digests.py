"""Digests of files, each read once as long as it does not change."""

import hashlib
import os
import stat
from pathlib import Path

from .files import digest_data, digest_file
from .numbered import is_there, numbered, options_of, plain
from .unchanged import while_unchanged


def digest_of(path: Path) -> str:
    """Digest of a file, read once as long as it does not change; '' where there is none."""
    if numbered(path):
        return _digest(path) if is_there(path) else ""
    try:
        regular = stat.S_ISREG(os.stat(plain(path)).st_mode)
    except FileNotFoundError:
        return ""
    return _digest(path) if regular else ""  # a pipe in its place would block whoever reads it


@while_unchanged(65536, kept=str)
def _digest(path: Path) -> str:
    sequence = numbered(path)
    if sequence is None:
        options, of_file = options_of(path), digest_file(plain(path))
        return digest_data([options, of_file]) if options else of_file
    files = [[number, digest_file(file)] for number, file in sequence.files().items()]
    return digest_data([sequence.options, files])


@while_unchanged(256)
def sha256_of(path: Path) -> str:
    """SHA-256 of a file in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
