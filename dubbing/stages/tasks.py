"""Who does the work of each stage. Each is called with a folder to fill and a progress function.

What does the work (and torch with it) is imported when it runs, not before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dfrf.config import STEPS, family
from dubbing import json_records as kept
from dubbing import timeline
from dubbing.engine.stage import Progress, digest_of
from dubbing.files import atomic_write_json
from dubbing.manifest.entries import Dub, Identity
from dubbing.provenance.mark_key import Marking

if TYPE_CHECKING:  # they load what a plan does without
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.provenance.credentials import Signer
    from dubbing.sync.result import SyncResult

SYNC_FILE = "sync.json"


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
    """Tracking, matte and background of a person's clip."""

    identity: Identity

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.preparation import prepare

        prepare(self.identity.clip, out, size=self.identity.size, progress=progress)


def iterations_of(identity: Identity) -> int:
    """Steps that a person learns: as the manifest says, or the default of their preset."""
    return identity.finetune.iterations or STEPS[family(identity.preset)]


@dataclass(frozen=True)
class Finetune:
    """A person's model, from the base checkpoint, the prepared clip and its sync check."""

    identity: Identity
    prepared: Prepared
    source_check: Path
    base: Path | None
    device: str
    references: int | None = None

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.finetune import FinetuneSettings, finetune

        wanted = self.identity
        settings = FinetuneSettings(
            preset=wanted.preset,
            iterations=iterations_of(wanted),
            seed=wanted.seed,
            speech=wanted.speech,
            speech_weights=None if wanted.speech_weights is None else str(wanted.speech_weights),
            references=self.references,
        )

        def step(state: Any) -> None:
            progress(str(state), state.step / state.iterations)

        finetune(
            self.prepared.load(),
            out,
            start=wanted.start,
            seconds=wanted.seconds,
            settings=settings,
            base=self.base,
            device=self.device,
            offset=offset_of(self.source_check),
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


@dataclass(frozen=True)
class Listen:
    """Speech features of a dub's sound."""

    dub: Dub
    features: str
    weights: Path | None
    rate: Fraction
    seconds: float

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.listen import listen

        progress("listening", 0.0)
        listen(
            self.dub.audio,
            out,
            name=self.features,
            weights=self.weights,
            rate=self.rate,
            start=self.dub.audio_start,
            seconds=self.seconds,
        )


@dataclass(frozen=True)
class Render:
    """The head for every frame of a dub."""

    dub: Dub
    model: Path
    prepared: Prepared
    poses: Path
    speech: Path
    device: str

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.finetune import MODEL_FILE
        from dubbing.stages.listen import Speech
        from dubbing.stages.refine_poses import with_refined_poses
        from dubbing.stages.render import render

        speech = Speech.load(self.speech)
        clip = with_refined_poses(self.prepared.load(), self.poses)
        render(
            self.model / MODEL_FILE,
            clip,
            speech.part,
            out,
            pose_index=pose_index(self.dub, clip, speech.frames),
            device=self.device,
            progress=progress,
        )


@dataclass(frozen=True)
class Composite:
    """Heads onto backgrounds, with the sound: the finished video."""

    dub: Dub
    heads: Path
    prepared: Prepared
    speech: Path
    seconds: float
    mark: Marking | None

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.composite import VideoSettings, make
        from dubbing.stages.listen import Speech

        dub, clip = self.dub, self.prepared.load()
        settings = VideoSettings(
            frame=dub.frame,
            label=dub.label,
            mark=self.mark,
            codec=dub.codec,
            audio_rate=None if dub.audio_rate == "source" else dub.audio_rate,
            audio_start=dub.audio_start,
            seconds=self.seconds,
        )
        make(
            self.heads,
            clip,
            dub.audio,
            out,
            pose_index=pose_index(dub, clip, Speech.load(self.speech).frames),
            settings=settings,
            progress=progress,
        )


@dataclass(frozen=True)
class Sign:
    """The finished video with signed credentials."""

    video: Path
    signer: Signer
    film: Path
    model: Path
    said: Mapping[str, Any]

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.provenance.credentials import sign
        from dubbing.stages.finetune import MODEL_FILE

        progress("signing", 0.0)
        said = {**self.said, "model": digest_of(self.model / MODEL_FILE)}
        sign(self.video, out / self.video.name, self.signer, self.film, said)


@dataclass(frozen=True)
class Check:
    """The lip-sync check of a video, beside that of the clip it was made from."""

    video: Path
    source: Path | None = None

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.sync.check import check

        own = read_check(self.source) if self.source is not None else None
        found = check(
            self.video, source=own, progress=lambda share: progress("listening and looking", share)
        )
        atomic_write_json(out / SYNC_FILE, found.to_json())


def read_check(path: Path) -> SyncResult | None:
    """A sync check that a stage wrote; None where there is none.

    Raises:
        DubbingError: it is something else.
    """
    from dubbing.sync.result import SyncResult

    if not path.is_file():
        return None
    return kept.read(path, SyncResult, "sync check")


def offset_of(folder: Path) -> int:
    """Frames by which the sound of a clip comes early, from the folder of its source check."""
    from dubbing.sync.result import sound_offset

    found = read_check(folder / SYNC_FILE)
    return sound_offset(found) if found is not None else 0


def pose_index(dub: Dub, clip: PreparedClip, frames: int) -> np.ndarray:
    """Frame of the clip for every frame of a dub, int64 (F,); see ``timeline.pose_index``."""
    first = timeline.first_frame(dub.video_start, clip.rate)
    return timeline.pose_index(frames, clip.segment, first, dub.on_longer_audio)
