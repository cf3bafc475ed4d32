"""The stage `sign`: the finished video with signed content credentials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from dubbing.engine.disk.file_digests import digest_of
from dubbing.engine.disk.numbered import plain
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.provenance.signer import Signer
from dubbing.stages.base import DubbingStage
from dubbing.video.files import video_file

if TYPE_CHECKING:
    from dubbing.production.dub import Dub


@dataclass(frozen=True, kw_only=True)
class Sign(DubbingStage):
    """Signs a video; see `dubbing.provenance.credentials`.

    Attributes:
        video: the stage that made it.
        codec: of the video, which its name depends on.
        film: an ingredient of the credentials.
        models: the stages that fine-tuned the people, by name.
        facts: stated in the credentials: consent, sound, mark.
    """

    video: Stage
    codec: str
    film: Path
    signer: Signer
    models: Mapping[str, Stage]
    facts: Any
    frames: Setting[int]

    # Bytes are copied and digested: far quicker than any frame is made.
    typical: ClassVar[Rate] = Rate(0.001, 3e3)

    @classmethod
    def of(cls, dub: Dub, signer: Signer, video: Stage, models: Mapping[str, Stage]) -> Self:
        """The stage for a dub."""
        return cls(
            video=video,
            codec=dub.settings.codec,
            film=plain(dub.film.path),
            signer=signer,
            models=models,
            facts=dub.signed_facts(),
            frames=dub.length,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.identity.learned import MODEL_FILE
        from dubbing.provenance.credentials import sign

        progress("signing", 0.0)
        models = [digest_of(stage.folder / MODEL_FILE) for stage in self.models.values()]
        video = video_file(self.video.folder, self.codec)
        facts = {**self.facts, "models": models}
        sign(video, video_file(out, self.codec), self.signer, self.film, facts)

    def amount(self) -> float:
        return self.frames
