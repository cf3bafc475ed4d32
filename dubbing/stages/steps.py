"""Who does the work of each stage. Each is called with a folder to fill and a progress function.

What does the work (and torch with it) is imported when it runs, not before.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from dfrf.config import STEPS, family
from dubbing import timeline
from dubbing.engine.stage import Progress
from dubbing.files import atomic_write_json
from dubbing.manifest.entries import Dub, Identity

if TYPE_CHECKING:
    from dubbing.sync.result import SyncResult

SYNC_FILE = "sync.json"


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
    prepared: Path
    source: Path
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

        def told(state: Any) -> None:
            progress(str(state), state.step / state.iterations)

        finetune(
            self.prepared,
            out,
            start=wanted.start,
            seconds=wanted.seconds,
            settings=settings,
            base=self.base,
            device=self.device,
            offset=offset_of(self.source),
            progress=told,
        )


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
    prepared: Path
    speech: Path
    device: str

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.finetune import MODEL_FILE
        from dubbing.stages.listen import Speech
        from dubbing.stages.render import render

        poses = poses_of(self.dub, self.prepared, self.speech)
        render(
            self.model / MODEL_FILE,
            self.prepared,
            Speech.load(self.speech).windows,
            out,
            pose_index=poses,
            device=self.device,
            progress=progress,
        )


@dataclass(frozen=True)
class Compose:
    """Heads onto backgrounds, with the sound: the finished video."""

    dub: Dub
    heads: Path
    prepared: Path
    speech: Path
    seconds: float

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.composite import VideoSettings, make

        dub = self.dub
        settings = VideoSettings(
            frame=dub.frame,
            label=dub.label,
            codec=dub.codec,
            audio_rate=None if dub.audio_rate == "source" else dub.audio_rate,
            audio_start=dub.audio_start,
            seconds=self.seconds,
        )
        make(
            self.heads,
            self.prepared,
            dub.audio,
            out,
            pose_index=poses_of(dub, self.prepared, self.speech),
            settings=settings,
            progress=progress,
        )


@dataclass(frozen=True)
class Check:
    """The lip-sync check of a video, beside that of the clip it was made from."""

    video: Path
    source: Path | None = None

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.sync.check import check

        def told(share: float) -> None:
            progress("listening and looking", share)

        own = read_check(self.source) if self.source is not None else None
        found = check(self.video, source=own, progress=told)
        atomic_write_json(out / SYNC_FILE, found.to_json())


def read_check(path: Path) -> SyncResult | None:
    """A sync check that a stage wrote; None where there is none."""
    from dubbing.sync.result import SyncResult

    if not path.is_file():
        return None
    return TypeAdapter(SyncResult).validate_json(path.read_bytes())


def offset_of(folder: Path) -> int:
    """Frames by which the sound of a clip comes early, from the folder of its source check."""
    from dubbing.sync.result import sound_offset

    found = read_check(folder / SYNC_FILE)
    return sound_offset(found) if found is not None else 0


def poses_of(dub: Dub, prepared: Path, speech: Path) -> np.ndarray:
    """Frame of the clip for every frame of a dub, int64 (F,); see ``timeline.pose_index``."""
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.stages.listen import Speech

    clip = PreparedClip.load(prepared)
    frames = Speech.load(speech).frames
    first = timeline.first_frame(dub.video_start, clip.rate)
    return timeline.pose_index(frames, clip.segment, first, dub.on_longer_audio)
