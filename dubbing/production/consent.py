"""The agreement of a person to be dubbed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubbing.digests import sha256_of


@dataclass(frozen=True)
class Consent:
    """The terms of an agreement, and the files that prove it.

    Attributes:
        by: who agreed.
        terms: all of them, as plain data.
        files: by the key that the SHA-256 of each has in a record.
    """

    by: str
    terms: Mapping[str, Any]
    files: Mapping[str, Path]

    def record(self) -> dict[str, Any]:
        """The terms, and the SHA-256 of the files, as results record them."""
        return {**self.terms, **{key: sha256_of(path) for key, path in self.files.items()}}

    def signed_record(self) -> dict[str, Any]:
        """The part of the record that signed credentials hold."""
        record = self.record()
        return {k: record[k] for k in ("reference", "sha256", "file_sha256") if k in record}
