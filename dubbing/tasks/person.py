"""What is made once for a person: the prepared clip, the model, the refined poses.

Each task is called with a folder to fill and a progress function. What does the work (and torch
with it) is imported when it runs, not before.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dfrf.config import STEPS, family
from dubbing.engine.stage import Progress
from dubbing.manifest.entries import Identity
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.tasks.check import offset_of

if TYPE_CHECKING:
    from dubbing.preparation.prepared import PreparedClip


@dataclass(frozen=True)
class Prepared:
    """Where a prepared clip lies, and the clip it was made from."""

    folder: Path
    clip: Path

    def load(self) -> PreparedClip:
        """See ``PreparedClip.load``."""
        from dubbing.preparation.prepared import PreparedClip

        return PreparedClip.load(self.folder, self.clip)


@dataclass(frozen=True)
class Prepare:
    """Tracking, matte and background of one of a person's clips."""

    identity: Identity
    clip: Path
    people: tuple[Portrait, ...]

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.preparation.prepare import prepare

        prepare(self.clip, out, size=self.identity.size, people=self.people, progress=progress)


def iterations_of(identity: Identity) -> int:
    """Steps that a person learns: of the manifest, or the default of the preset."""
    return identity.finetune.iterations or STEPS[family(identity.preset)]


@dataclass(frozen=True)
class Finetune:
    """A person's model, from the base checkpoint, prepared clips and their sync checks."""

    identity: Identity
    prepared: tuple[Prepared, ...]
    source_checks: tuple[Path, ...]
    base: Path | None
    device: str

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.finetune import finetune
        from dubbing.stages.initial_model import FinetuneSettings

        wanted = self.identity
        settings = FinetuneSettings(
            preset=wanted.preset,
            iterations=iterations_of(wanted),
            seed=wanted.seed,
            speech=wanted.speech,
            speech_weights=None if wanted.speech_weights is None else str(wanted.speech_weights),
            references=wanted.finetune.references,
            learning_rate=wanted.finetune.learning_rate,
            rays=wanted.finetune.rays,
        )

        def step(state: Any) -> None:
            message = str(state).rpartition(", ")[0]  # without its own guess of the time left
            progress(message, state.step / state.iterations)

        finetune(
            [
                (prepared.load(), offset_of(check))
                for prepared, check in zip(self.prepared, self.source_checks, strict=True)
            ],
            out,
            start=wanted.learned_start,
            seconds=wanted.learned_seconds,
            settings=settings,
            base=self.base,
            device=self.device,
            progress=step,
        )


@dataclass(frozen=True)
class RefinePoses:
    """Head poses of every frame of a person's clip, refined with the learned head."""

    model: Path
    prepared: Prepared
    device: str

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.finetune import MODEL_FILE
        from dubbing.stages.refine_poses import refine_clip
        from dubbing.stages.render import load

        model, maps, _ = load(self.model / MODEL_FILE, self.device)
        refine_clip(model, maps, self.prepared.load(), out, progress)
