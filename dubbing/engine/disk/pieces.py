"""Pieces of a result that need not be made again, as the last result has them already."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from ..errors import ExplainedError
from . import json_records
from .files import atomic_path, atomic_write_json

FOLDER = "made_of"


@dataclass(frozen=True)
class Pieces:
    """The pieces of a result, and beside them a digest of what each is made of.

    Attributes:
        out: folder of the result that is being made.
        last: folder of the last result; see `Stage.last`.
    """

    out: Path
    last: Path | None

    def same(self, name: str, made_of: str) -> bool:
        """Note what a piece is made of; whether the last result has it, made of the same."""
        note = Path(FOLDER, f"{name}.json")
        atomic_write_json(self.out / note, made_of)
        if self.last is None:
            return False
        try:
            return json_records.read(self.last / note, str, "digest") == made_of
        except ExplainedError:
            return False

    def take(self, name: str, made_of: str) -> bool:
        """Copy a file of the last result that is made of the same; whether there is one."""
        if not self.same(name, made_of) or self.last is None:
            return False
        with atomic_path(self.out / name) as temporary:
            shutil.copyfile(self.last / name, temporary)
        return True
