"""SHA-256 of files, as other tools report it."""

import hashlib
from pathlib import Path

from dubbing.engine.disk.files import while_unchanged


@while_unchanged(256)
def sha256_of(path: Path) -> str:
    """SHA-256 of a file in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
