"""Pieces of a result that need not be made again, as the last result has them already."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import json_records
from .files import atomic_path, atomic_write_json, digest_data

FOLDER = "made_of"


@dataclass(frozen=True)
class Pieces:
    """The pieces of a result, and beside them a digest of what each is made of.

    Attributes:
        out: folder of the result that is being made.
        last: folder of the last result; see `Stage.last`.
        made_by: digest of code, and of what all pieces are made of.
    """

    out: Path
    last: Path | None
    made_by: str = ""

    def same(self, name: str, made_of: Sequence[Any]) -> list[bool]:
        """Note what the parts of a piece are made of, plain data; which the last result has."""
        digests = [digest_data([self.made_by, part]) for part in made_of]
        atomic_write_json(_note(self.out, name), digests)
        before = digests_of(self.last, name) if self.last is not None else []
        if len(before) != len(digests):
            return [False] * len(digests)
        return [one == other for one, other in zip(before, digests, strict=True)]

    def take(self, name: str, made_of: Any) -> bool:
        """Copy a file of the last result that is made of the same; whether there is one."""
        if not all(self.same(name, [made_of])):
            return False
        self.copy(name)
        return True

    def copy(self, name: str) -> None:
        """Copy a file of the last result."""
        assert self.last is not None
        with atomic_path(self.out / name) as temporary:
            shutil.copyfile(self.last / name, temporary)


def digests_of(folder: Path, name: str) -> list[str]:
    """Digests of all that the parts of a piece in a folder are made of; none without a note."""
    return json_records.read_or([], _note(folder, name), list[str])


def _note(folder: Path, name: str) -> Path:
    return folder / FOLDER / f"{name}.json"
