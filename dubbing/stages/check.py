"""The stage `check`: lip sync of a finished video, beside that of its film."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.files import atomic_write_json, digest_data
from dubbing.engine.disk.numbered import with_options
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.mixing.sound import VOICES
from dubbing.stages.base import DubbingStage
from dubbing.sync.network.weight_path import CHECK_WEIGHTS
from dubbing.sync.records import SYNC_FILE, read_check
from dubbing.video.files import options_of_video, video_file

if TYPE_CHECKING:
    from dubbing.production.dub import Dub


@dataclass(frozen=True, kw_only=True)
class Check(DubbingStage):
    """Checks the lip sync of a video; see `dubbing.sync.check`.

    Attributes:
        video: the stage that made it.
        source: the stage that checked the film.
        codec: of the video, which its name depends on.
        options: how it is read; see `options_of_video`.
        spoken: frames (first, stop) of the cues. Others are not looked at.
        credits: frames of the card at the end, which are not looked at.
    """

    video: Stage
    source: Stage
    codec: str
    options: Mapping[str, str]
    spoken: tuple[tuple[int, int], ...]
    credits: int
    weights: Mapping[str, Path]

    typical: ClassVar[Rate] = Rate(0.012, 40.0)

    @classmethod
    def of(cls, dub: Dub, video: Stage, source: Stage) -> Self:
        """The stage for a dub."""
        return cls(
            video=video,
            source=source,
            codec=dub.settings.codec,
            options=options_of_video(dub.film.path, dub.settings.frame),
            spoken=tuple((cue.first, min(cue.stop, dub.length)) for cue in dub.cues),
            credits=card.frames if (card := dub.settings.card) else 0,
            weights=CHECK_WEIGHTS,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.engine.disk.pieces import Pieces
        from dubbing.sync.check import check

        weights, options = map(digest_of, self.weights.values()), dict(self.options)
        made_by = digest_data([self.version, options, *weights])
        voices = self.video.folder / VOICES
        result = check(
            with_options(video_file(self.video.folder, self.codec), options),
            source=read_check(self.source.folder),
            voices=voices if voices.is_file() else None,
            parts=self.spoken,
            leave_out=self.credits,
            progress=lambda share: progress("listening and looking", share),
            pieces=Pieces(out, self.last, made_by),
        )
        atomic_write_json(out / SYNC_FILE, result.to_json())

    def amount(self) -> float:
        return sum(stop - first for first, stop in self.spoken)
