"""The stage `refine_poses`: what the learned head says of a clip: poses, and what lies over it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.graph.fields import Setting
from dubbing.engine.graph.stage import Progress, Rate, Stage
from dubbing.face.weight_paths import HAND_WEIGHTS
from dubbing.stages.base import DubbingStage, Prepared

if TYPE_CHECKING:
    from dubbing.production.clip import PersonClip
    from dubbing.production.person import Person


@dataclass(frozen=True, kw_only=True)
class RefinePoses(DubbingStage):
    """Refines poses and finds what lies over the face; see `dubbing.heads.film_findings`.

    Attributes:
        crops: frames, each as a share of a full head crop.
        weights: of the networks that find hands.
    """

    model: Stage
    prepared: Prepared
    weights: Mapping[str, Path]
    crops: Setting[float]
    device: Setting[str]

    typical: ClassVar[Rate] = Rate(0.02, 70.0)

    @classmethod
    def of(
        cls, person: Person, clip: PersonClip, prepared: Prepared, model: Stage, device: str
    ) -> Self:
        """The stage for a clip of a person."""
        return cls(
            model=model,
            prepared=prepared,
            weights=HAND_WEIGHTS,
            crops=clip.used_frames * person.crops(clip),
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        from dubbing.heads.film_findings import find
        from dubbing.identity.learned import MODEL_FILE

        find(self.model.folder / MODEL_FILE, self.prepared.load(), out, self.device, progress)

    def amount(self) -> float:
        return self.crops
