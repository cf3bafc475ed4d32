"""Digests of files, each read once as long as it does not change."""

import os
import stat
from pathlib import Path

from .files import digest_file, while_unchanged


def digest_of(path: Path) -> str:
    """Digest of a file, read once as long as it does not change; '' where there is none."""
    try:
        regular = stat.S_ISREG(os.stat(path).st_mode)
    except FileNotFoundError:
        return ""
    return _digest(path) if regular else ""  # a pipe in its place would block whoever reads it


@while_unchanged(65536)
def _digest(path: Path) -> str:
    return digest_file(path)
