"""The stage `still`: one image of a finished video."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.stage import Progress, Rate, Stage
from dubbing.stages.base import DubbingStage
from dubbing.video.files import video_file

if TYPE_CHECKING:
    from dubbing.production.dub import Dub


@dataclass(frozen=True, kw_only=True)
class Still(DubbingStage):
    """Writes the middle frame of a video as PNG.

    Attributes:
        video: the stage that made it.
        codec: of the video, which its name depends on.
        frame: that is written.
    """

    video: Stage
    codec: str
    frame: int

    typical: ClassVar[Rate] = Rate(0.1, 1e6)

    @classmethod
    def of(cls, dub: Dub, video: Stage) -> Self:
        """The stage for a dub."""
        return cls(video=video, codec=dub.settings.codec, frame=dub.length // 2)

    def run(self, out: Path, progress: Progress) -> None:
        from PIL import Image

        from dubbing.media import read_frames

        video = video_file(self.video.folder, self.codec)
        (frame,) = read_frames(video, start=self.frame, count=1)
        Image.fromarray(frame).save(out / "still.png")
