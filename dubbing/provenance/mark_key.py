"""The secret of the invisible mark: of this installation, or a file of one's own."""

import hashlib
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.engine.disk.files import digest_data, make_folder, read_bounded, sync_file, writing
from dubbing.engine.graph.fields import Setting
from dubbing.errors import CallError, ExplainedError
from dubbing.homes import settings_folder

BYTES = 32
MIN_BYTES, MAX_BYTES = 16, 4096  # of a key file
HOMELESS = "the key of the invisible mark has no place: this user has no home folder"
REMEDY = "name a key of your own in the manifest, `mark: {key: FILE}`, or set `mark: false`"


@dataclass(frozen=True)
class Marking:
    """The mark to draw: 64 bits, by a key that lies in a file.

    Attributes:
        key_file: where the key lies; None for a user without a home.
        fingerprint: of the key, which is safe to show; empty where there is no key yet.
        id: the 64 bits in hexadecimal.
    """

    key_file: Setting[Path | None]
    fingerprint: str
    id: str

    def key(self) -> bytes:
        """The key.

        Raises:
            ExplainedError: it cannot be read, or is another one than ``fingerprint`` names.
        """
        if self.key_file is None:
            raise ExplainedError(HOMELESS, remedy=REMEDY)
        key = read_key(self.key_file)
        if fingerprint_of(key) != self.fingerprint:
            raise ExplainedError("another key than when the run began", str(self.key_file), REMEDY)
        return key


def marking(own: Path | None, made_of: object) -> Marking:
    """The mark of a dub.

    Args:
        own: the key file that the manifest names; the installation's by default.
        made_of: plain data that names the inputs of the dub: the 64 bits are its digest.
    """
    file = own or installation_file()
    known = fingerprint_of(read_key(file)) if file and (own or file.exists()) else ""
    return Marking(file, known, digest_data(made_of)[: 64 // 4])


def installation_file() -> Path | None:
    """Where the key of this installation lies, or will; None for a user without a home."""
    folder = settings_folder()
    return folder / "mark.key" if folder else None


def make_installation_key() -> Path:
    """The file of this installation's key, which is created at first use.

    Raises:
        CallError: the user has no home.
        ExplainedError: it cannot be made.
    """
    file = installation_file()
    if file is None:
        raise CallError(HOMELESS, remedy=REMEDY)
    if not file.exists():
        try:
            make_folder(file.parent)
        except ExplainedError as error:
            what = f"the key of the invisible mark cannot be made: {error.what}"
            raise CallError(what, error.where, REMEDY) from error
        temporary = file.with_name(f".{file.name}.{os.getpid()}")
        with writing(file):
            temporary.unlink(missing_ok=True)
            handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(handle, "wb") as stream:
                stream.write(secrets.token_bytes(BYTES))
            sync_file(temporary)
            try:
                os.link(temporary, file)  # of two that make one at once, the first stays
            except FileExistsError:
                pass
            except OSError:  # a file system without hard links
                os.replace(temporary, file)
            temporary.unlink(missing_ok=True)
            sync_file(file.parent)
    read_key(file)
    return file


def read_key(file: Path) -> bytes:
    """The key in a file: a digest of all that the file holds.

    Raises:
        ExplainedError: there is none, or it is too short to be a secret.
    """
    try:
        content = read_bounded(file, MAX_BYTES)
    except OSError as error:
        what = f"the mark's key cannot be read: {error.strerror}"
        raise ExplainedError(what, str(file), REMEDY) from error
    if len(content) < MIN_BYTES:
        what = f"the mark's key has {len(content)} bytes, it needs {MIN_BYTES} at least"
        raise ExplainedError(what, str(file), "fill it with random bytes")
    return hashlib.blake2b(content, digest_size=BYTES).digest()


def fingerprint_of(key: bytes) -> str:
    """Names a key without revealing it."""
    return hashlib.blake2b(key, digest_size=8, person=b"dfrf-mark").hexdigest()


def bits_of(number: str) -> np.ndarray:
    """64 bits (64,) uint8 of 16 hexadecimal digits, the highest first."""
    return np.unpackbits(np.frombuffer(bytes.fromhex(number), np.uint8))


def id_of(bits: np.ndarray) -> str:
    """16 hexadecimal digits of 64 bits (64,)."""
    return np.packbits(bits).tobytes().hex()
