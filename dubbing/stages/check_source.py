"""The stage `check_source`: lip sync of a clip itself, to which its dubs are compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.disk.files import atomic_write_json
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate
from dubbing.stages.base import DubbingStage
from dubbing.sync.network.weight_path import CHECK_WEIGHTS
from dubbing.sync.records import SYNC_FILE

if TYPE_CHECKING:
    from dubbing.production.clip import PersonClip


@dataclass(frozen=True, kw_only=True)
class CheckSource(DubbingStage):
    """Checks the lip sync of a clip; see `dubbing.sync.check`.

    Attributes:
        part: the only frames, first .. stop, that are checked; None for all.
    """

    clip: Path
    part: tuple[int, int] | None = None
    weights: Mapping[str, Path]
    frames: Setting[int]

    typical: ClassVar[Rate] = Rate(0.01, 10.0)

    @classmethod
    def of(cls, clip: PersonClip) -> Self:
        """The stage for a clip."""
        return cls(clip=clip.path, part=clip.part, weights=CHECK_WEIGHTS, frames=clip.used_frames)

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.sync.check import check

        result = check(
            self.clip,
            parts=None if self.part is None else [self.part],
            progress=lambda share: progress("listening and looking", share),
        )
        atomic_write_json(out / SYNC_FILE, result.to_json())

    def amount(self) -> float:
        return self.frames
