"""The stage `prepare`: tracking, matte and background of one of a person's clips."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate
from dubbing.face.weight_paths import FACE_WEIGHTS, PERSON_WEIGHTS
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.sound_to_lips.paths import LIP_WEIGHTS
from dubbing.stages.base import DubbingStage

if TYPE_CHECKING:
    from dubbing.production.clip import PersonClip
    from dubbing.production.person import Person


@dataclass(frozen=True, kw_only=True)
class Prepare(DubbingStage):
    """Makes a prepared clip; see `dubbing.preparation.prepare`.

    Attributes:
        size: most px of the head crop's side.
        people: the person, then the others in the clip.
        part: the only frames, first .. stop, that are prepared, where they show the face; None for
            all.
        crops: amount of work: frames, each as a share of a full head crop.
    """

    clip: Path
    size: int
    people: tuple[Portrait, ...]
    part: tuple[int, int] | None = None
    weights: Mapping[str, Path]
    crops: Setting[float]

    typical: ClassVar[Rate] = Rate(0.058, 27e3)

    @classmethod
    def of(cls, person: Person, clip: PersonClip) -> Self:
        """The stage for a clip of a person."""
        return cls(
            clip=clip.path,
            size=person.size,
            people=clip.portraits,
            part=clip.part,
            weights={**FACE_WEIGHTS, **PERSON_WEIGHTS, **LIP_WEIGHTS},
            crops=clip.used_frames * person.crops(clip),
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.errors import PreparationError
        from dubbing.preparation.prepare import prepare

        for part in dict.fromkeys((self.part, None)):
            try:
                prepare(
                    self.clip,
                    out,
                    size=self.size,
                    people=self.people,
                    part=part,
                    progress=progress,
                )
                return
            except PreparationError:  # a part may show nobody; all of the clip must
                if part is None:
                    raise

    def amount(self) -> float:
        return self.crops
