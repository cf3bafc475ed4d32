"""The lip-sync check of a video or a clip, as a task, and how its result is read back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dubbing import json_records
from dubbing.engine.stage import Progress
from dubbing.files import atomic_write_json
from dubbing.manifest.findings import Scene
from dubbing.stages.kinds import SYNC_FILE

if TYPE_CHECKING:
    from dubbing.sync.result import SyncResult


@dataclass(frozen=True)
class Check:
    """The lip-sync check of a video, beside that of the clip it was made from.

    Attributes:
        source: the check of that clip.
        scene: its cues become the segments; the other frames are not looked at.
        credits: frames of the card at the end, which are not looked at.
    """

    video: Path
    source: Path | None = None
    scene: Scene | None = None
    credits: int = 0

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.mixing.mix import VOICES
        from dubbing.sync.check import check

        found = check(
            self.video,
            source=read_check(self.source) if self.source else None,
            sound_from=self.video.with_name(VOICES) if self.scene else None,
            parts=[(cue.first, cue.stop) for cue in self.scene.cues] if self.scene else None,
            leave_out=self.credits,
            progress=lambda share: progress("listening and looking", share),
        )
        atomic_write_json(out / SYNC_FILE, found.to_json())


def read_check(path: Path) -> SyncResult | None:
    """A sync check that a stage wrote; None where there is none.

    Raises:
        DubbingError: it is something else.
    """
    from dubbing.sync.result import SyncResult

    return json_records.read(path, SyncResult, "sync check") if path.is_file() else None


def offset_of(folder: Path) -> int:
    """Frames by which the sound of a clip comes early, from the folder of its source check."""
    from dubbing.sync.judgement import sound_offset

    found = read_check(folder / SYNC_FILE)
    return sound_offset(found) if found is not None else 0
