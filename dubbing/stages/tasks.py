"""Who does the work of each stage. Each is called with a folder to fill and a progress function.

What does the work (and torch with it) is imported when it runs, not before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dfrf.config import STEPS, family
from dubbing import json_records as kept
from dubbing import timeline
from dubbing.engine.stage import Progress, digest_of
from dubbing.files import atomic_write_json
from dubbing.identity.learned import learned_seconds
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.findings import Scene
from dubbing.portraits import Portrait
from dubbing.provenance.card import CreditsCard
from dubbing.provenance.mark_key import Marking
from dubbing.timeline import Cue

if TYPE_CHECKING:  # they load what a plan does without
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.provenance.credentials import Signer
    from dubbing.sync.result import SyncResult

SYNC_FILE = "sync.json"
PART = 250  # frames that are rendered on one machine: a multiple of every method's segment


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
        from dubbing.preparation import prepare

        prepare(self.clip, out, size=self.identity.size, people=self.people, progress=progress)


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
            start=wanted.learned_start,
            seconds=wanted.learned_seconds,
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
    """Speech features of a cue's sound."""

    cue: Cue
    features: str
    weights: Path | None
    rate: Fraction

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.listen import listen

        progress("listening", 0.0)
        listen(
            self.cue.audio,
            out,
            name=self.features,
            weights=self.weights,
            rate=self.rate,
            start=self.cue.audio_start,
            seconds=self.cue.seconds,
        )


@dataclass(frozen=True)
class Render:
    """The head for every frame of a cue."""

    dub: Dub
    cue: Cue
    model: Path
    prepared: Prepared
    poses: Path
    speech: Path
    device: str
    part: tuple[int, int] | None = None  # of the cue's frames: first and stop; all by default

    @property
    def frames(self) -> int:
        """How many it renders."""
        first, stop = self.part or (self.cue.first, self.cue.stop)
        return stop - first

    def parts(self) -> dict[str, Render]:
        """The same in ranges of frames, where there are several."""
        count = self.frames
        ranges = [(k, min(k + PART, count)) for k in range(0, count, PART)]
        named = {f"{first}-{stop}": (first, stop) for first, stop in ranges}
        if len(named) < 2:
            return {}
        return {name: replace(self, part=part) for name, part in named.items()}

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
            pose_index=pose_index(self.dub, clip, self.cue.stop)[self.cue.first : self.cue.stop],
            part=self.part,
            device=self.device,
            progress=progress,
        )


@dataclass(frozen=True)
class Learned:
    """The prepared clip that a person was learned from, and the fine-tune that says which part."""

    prepared: Prepared
    finetune: Path


@dataclass(frozen=True)
class CueHeads:
    """Where the heads of a cue lie, the prepared clip that they go onto, what was learned from."""

    cue: Cue
    folder: Path
    prepared: Prepared
    learned: Learned


@dataclass(frozen=True)
class Composite:
    """Heads onto the film, with the sound: the finished video."""

    dub: Dub
    scene: Scene
    heads: tuple[CueHeads, ...]
    mark: Marking | None
    card: CreditsCard | None

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.stages.composer import Heads, VideoSettings
        from dubbing.stages.composite import SceneSound, Sound, make
        from dubbing.stages.own_pixels import learned_views, reasons

        dub, scene = self.dub, self.scene
        clips = {h.prepared: h.prepared.load() for h in self.heads}
        film = next(iter(clips.values()))
        kept = {}
        for h in self.heads:
            if h.prepared not in kept:
                seconds = learned_seconds(h.learned.finetune)
                views = learned_views(h.learned.prepared.load(), seconds)
                kept[h.prepared] = reasons(clips[h.prepared], views)
        poses = pose_index(dub, film, max(cue.stop for cue in scene.cues))
        settings = VideoSettings(
            frame=dub.frame,
            label=dub.label.mark,
            card=self.card,
            mark=self.mark,
            codec=dub.codec,
            audio_rate=None if dub.audio_rate == "source" else dub.audio_rate,
        )
        sound: Sound | SceneSound
        if dub.lines is None:
            (cue,) = scene.cues
            sound = Sound(cue.audio, cue.audio_start, cue.seconds)
        else:
            sound = SceneSound(scene.cues, dub.music_effects, scene.left, dub.loudness)
        make(
            [
                Heads(
                    *(h.folder, clips[h.prepared], h.cue.first, h.cue.stop),
                    *(kept[h.prepared], h.cue.name),
                )
                for h in self.heads
            ],
            sound,
            out,
            pose_index=poses,
            settings=settings,
            progress=progress,
        )


@dataclass(frozen=True)
class Sign:
    """The finished video with signed credentials."""

    video: Path
    signer: Signer
    film: Path
    models: tuple[Path, ...]
    said: Mapping[str, Any]

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.provenance.credentials import sign
        from dubbing.stages.finetune import MODEL_FILE

        progress("signing", 0.0)
        models = [digest_of(folder / MODEL_FILE) for folder in self.models]
        said = {**self.said, "models": models}
        sign(self.video, out / self.video.name, self.signer, self.film, said)


@dataclass(frozen=True)
class Check:
    """The lip-sync check of a video, beside that of the clip it was made from.

    The frames of a card of credits, the last ones, are not looked at. Of a scene each cue is
    judged, whose frames alone are looked at: a segment each.
    """

    video: Path
    source: Path | None = None
    lines: Scene | None = None
    credits: int = 0

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.sync.check import check

        own = read_check(self.source) if self.source is not None else None
        scene: dict[str, Any] = {}
        if self.lines is not None:  # what is new in a scene, by its voices alone
            scene["parts"] = [(cue.first, cue.stop) for cue in self.lines.cues]
            from dubbing.mixing.mix import VOICES

            scene["sound_from"] = self.video.with_name(VOICES)
        found = check(
            self.video,
            source=own,
            leave_out=self.credits,
            progress=lambda share: progress("listening and looking", share),
            **scene,
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
    """Frame of the clip for every frame of a dub, int64 (F,); see ``timeline.pose_index``.

    A scene has the frames of its film.
    """
    if dub.lines is not None:
        return np.arange(len(clip))
    first = timeline.first_frame(dub.video_start, clip.rate)
    return timeline.pose_index(frames, clip.segment, first, dub.on_longer_audio)
