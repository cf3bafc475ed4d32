"""What is made for a dub: speech features and heads of each cue, the video, its credentials.

Each task is called with a folder to fill and a progress function. What does the work (and torch
with it) is imported when it runs, not before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dubbing.engine.stage import Progress, digest_of
from dubbing.identity.learned import learned
from dubbing.manifest.entries import Dub
from dubbing.manifest.findings import Scene
from dubbing.provenance.card import CreditsCard
from dubbing.provenance.mark_key import Marking
from dubbing.script import timeline
from dubbing.script.timeline import Cue
from dubbing.tasks.person import Prepared

if TYPE_CHECKING:
    from dubbing.preparation.prepared import PreparedClip
    from dubbing.provenance.credentials import Signer

PART = 250  # frames that are rendered on one machine: a multiple of every method's segment


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
class CueHeads:
    """The rendered heads of a cue.

    Attributes:
        folder: where they lie.
        prepared: the clip that they go onto.
        learned: the clip that the person was learned from.
        finetune: folder of the stage that recorded which seconds.
    """

    cue: Cue
    folder: Path
    prepared: Prepared
    learned: tuple[Prepared, ...]
    finetune: Path


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
        for h in {h.prepared: h for h in self.heads}.values():
            parts = zip(h.learned, learned(h.finetune), strict=True)
            views = [learned_views(of.load(), seconds) for of, (_, seconds) in parts]
            kept[h.prepared] = reasons(clips[h.prepared], np.concatenate(views))
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
        heads = [
            Heads(
                h.folder, clips[h.prepared], h.cue.first, h.cue.stop, kept[h.prepared], h.cue.name
            )
            for h in self.heads
        ]
        make(heads, sound, out, pose_index=poses, settings=settings, progress=progress)


@dataclass(frozen=True)
class Sign:
    """The finished video with signed credentials."""

    video: Path
    signer: Signer
    film: Path
    models: tuple[Path, ...]
    facts: Mapping[str, Any]

    def __call__(self, out: Path, progress: Progress) -> None:
        from dubbing.provenance.credentials import sign
        from dubbing.stages.finetune import MODEL_FILE

        progress("signing", 0.0)
        models = [digest_of(folder / MODEL_FILE) for folder in self.models]
        facts = {**self.facts, "models": models}
        sign(self.video, out / self.video.name, self.signer, self.film, facts)


def pose_index(dub: Dub, clip: PreparedClip, frames: int) -> np.ndarray:
    """Frame of the clip for every frame of a dub, int64 (F,); see ``timeline.pose_index``.

    A scene has the frames of its film.
    """
    if dub.lines is not None:
        return np.arange(len(clip))
    first = timeline.first_frame(dub.video_start, clip.rate)
    return timeline.pose_index(frames, clip.segment, first, dub.on_longer_audio)
