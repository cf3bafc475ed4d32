"""Pieces of a result that need not be made again, as the last result has them already."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ExplainedError
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

    def same(self, name: str, made_of: Any) -> Path | None:
        """Note what a piece is made of, plain data; the last result, if that piece is the same."""
        note, digest = Path(FOLDER, f"{name}.json"), digest_data([self.made_by, made_of])
        atomic_write_json(self.out / note, digest)
        if self.last is None:
            return None
        try:
            same = json_records.read(self.last / note, str, "digest") == digest
        except ExplainedError:
            return None
        return self.last if same else None

    def take(self, name: str, made_of: Any) -> bool:
        """Copy a file of the last result that is made of the same; whether there is one."""
        if (last := self.same(name, made_of)) is None:
            return False
        with atomic_path(self.out / name) as temporary:
            shutil.copyfile(last / name, temporary)
        return True
