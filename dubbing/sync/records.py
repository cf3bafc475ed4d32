"""Results of sync checks that stages keep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dubbing.engine.disk import json_records

if TYPE_CHECKING:
    from dubbing.sync.result import SyncResult

SYNC_FILE = "sync.json"


def read_check(folder: Path) -> SyncResult | None:
    """The result that a stage left in its folder; None where there is none.

    Raises:
        ExplainedError: the file holds something else.
    """
    from dubbing.sync.result import SyncResult

    path = folder / SYNC_FILE
    return json_records.read(path, SyncResult, "sync check") if path.is_file() else None


def offset_of(folder: Path) -> int:
    """Frames by which the sound of a clip comes early, from the folder of its check."""
    from dubbing.sync.judgement import sound_offset

    result = read_check(folder)
    return sound_offset(result) if result is not None else 0
