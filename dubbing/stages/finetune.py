"""The stage `finetune`: a person's model, from the base and prepared clips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from dfrf.config import family
from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.face.weight_paths import HAND_WEIGHTS
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.stages.base import DubbingStage, Prepared

if TYPE_CHECKING:
    from dubbing.production.person import Person

REFINED = 0.2  # steps of learning that refining the poses of one full head crop is worth
# A step of preset `paper` on two processor cores at 512 px, half of the time that
# one core took: its rays, and the features of its references (see the page on performance).
PAPER_RAYS_SECONDS, PAPER_FEATURES_SECONDS = 12.0, 22.0
PIXEL_BYTES = 24  # of memory, for each pixel of a learned crop
FULL_CROP = 512**2  # pixels


@dataclass(frozen=True)
class LearnedClip:
    """A prepared clip to learn from, and the check of its lip sync, which knows its offset."""

    prepared: Prepared
    source: Stage


@dataclass(frozen=True, kw_only=True)
class Finetune(DubbingStage):
    """Fine-tunes a person; see `dubbing.heads.fine_tuning`.

    Attributes:
        clips: to learn from, the main one first.
        start, seconds: see `Person`.
        base: checkpoint to start from; None for random weights.
        weights: of the speech features of the settings, and of the networks that find hands.
        crops: learned frames, each as a share of a full head crop.
    """

    clips: tuple[LearnedClip, ...]
    start: float | None
    seconds: float
    settings: FinetuneSettings
    base: Path | None
    weights: Mapping[str, Path]
    crops: Setting[float]
    device: Setting[str]

    typical: ClassVar[Rate] = Rate(0.19, 10e3)

    @classmethod
    def of(cls, person: Person, clips: Sequence[LearnedClip], device: str) -> Self:
        """The stage for a person."""
        return cls(
            clips=tuple(clips),
            start=person.start,
            seconds=person.seconds,
            settings=person.settings,
            base=person.base,
            weights={**person.speech_files, **HAND_WEIGHTS},
            crops=person.learned_frames * person.crops(person.clip),
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.heads.fine_tuning import finetune
        from dubbing.sync.records import offset_of

        def step(state: Any) -> None:
            message = str(state).rpartition(", ")[0]  # without its own guess of the time left
            progress(message, state.step / state.iterations)

        finetune(
            [(clip.prepared.load(), offset_of(clip.source.folder)) for clip in self.clips],
            out,
            start=self.start,
            seconds=self.seconds,
            settings=self.settings,
            base=self.base,
            device=self.device,
            progress=step,
        )

    def amount(self) -> float:
        steps = self.settings.steps(from_base=self.base is not None)
        return steps + REFINED * self.crops

    def memory(self) -> float:
        return super().memory() + PIXEL_BYTES * FULL_CROP * self.crops

    def rate_kind(self) -> str:
        return f"{self.kind} paper" if self._is_paper else self.kind

    def typical_rate(self) -> Rate:
        if not self._is_paper:
            return self.typical
        return Rate(PAPER_RAYS_SECONDS + PAPER_FEATURES_SECONDS, self.typical.bytes)

    @property
    def _is_paper(self) -> bool:
        """Whether the preset takes a hundred times as long for a step."""
        return family(self.settings.preset) == "paper"
