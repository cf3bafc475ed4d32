"""The stage `refine_poses`: what the learned head says of a clip: poses, and what lies over it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from dubbing.engine.fields import Setting
from dubbing.engine.stage import Progress, Rate, Stage
from dubbing.stages.base import DubbingStage, Prepared

if TYPE_CHECKING:
    from dubbing.production.clip import PersonClip
    from dubbing.production.person import Person


POSES_SHARE = 0.7  # of the stage's time


@dataclass(frozen=True, kw_only=True)
class RefinePoses(DubbingStage):
    """Refines poses, and finds what lies over the face.

    See `dubbing.heads.pose_refinement` and `dubbing.heads.covers`.

    Attributes:
        crops: frames, each as a share of a full head crop.
    """

    model: Stage
    prepared: Prepared
    crops: Setting[float]
    device: Setting[str]

    typical: ClassVar[Rate] = Rate(0.048, 70.0)

    @classmethod
    def of(
        cls, person: Person, clip: PersonClip, prepared: Prepared, model: Stage, device: str
    ) -> Self:
        """The stage for a clip of a person."""
        return cls(
            model=model,
            prepared=prepared,
            crops=clip.frames * person.crops(clip),
            device=device,
        )

    def run(self, out: Path, progress: Progress) -> None:
        import numpy as np

        from dubbing.heads.covers import find_covers
        from dubbing.heads.fine_tuning import MODEL_FILE
        from dubbing.heads.pose_refinement import refined, write_poses
        from dubbing.heads.rendering import load

        model, maps, _ = load(self.model.folder / MODEL_FILE, self.device)
        clip = self.prepared.load()

        def first(message: str, share: float) -> None:
            progress(message, POSES_SHARE * share)

        def then(message: str, share: float) -> None:
            progress(message, POSES_SHARE + (1 - POSES_SHARE) * share)

        clip = refined(model, maps, clip, np.arange(len(clip)), first)
        write_poses(find_covers(model, maps, clip, out, then), out)

    def amount(self) -> float:
        return self.crops
