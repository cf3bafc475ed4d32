"""The stages of a manifest: what each reads, what its result depends on, and who does it.

The people who do the work (and torch with them) are imported when a stage runs, not before.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubbing import timeline
from dubbing.engine.stage import Stage
from dubbing.errors import DubbingError, RenderingError
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.manifest import Manifest
from dubbing.media import SUFFIX
from dubbing.shipped.base import shipped_base
from dubbing.speech import features
from dubbing.stages import steps

# Raised when a stage would give something else for the same inputs.
VERSIONS = {
    "prepare": 8,
    "finetune": 17,
    "source": 2,
    "speech": 1,
    "heads": 12,
    "video": 4,
    "sync": 2,
}
NEEDS = {  # the stages of the identity that a dub's stage waits for
    "speech": (),
    "heads": ("prepare", "source", "finetune"),
    "video": ("prepare",),
    "sync": (),  # without the source's own figures it still says something
}


@dataclass(frozen=True)
class Job:
    """One identity or one dub: its stages in order.

    Attributes:
        kind: ``identity`` or ``dub``.
        waits_for: name of the identity a dub needs; '' for an identity.
        blocked: why it cannot be done at all (a damaged file, speech too long), known beforehand.
    """

    kind: str
    name: str
    stages: dict[str, Stage]
    waits_for: str = ""
    blocked: DubbingError | None = None


@dataclass(frozen=True)
class Jobs:
    """All jobs of a run."""

    identities: dict[str, Job]
    dubs: dict[str, Job]

    def all(self) -> list[Job]:
        return [*self.identities.values(), *self.dubs.values()]


def build(manifest: Manifest, *, only: tuple[str, ...] = (), device: str = "auto") -> Jobs:
    """The jobs of a manifest, or of those identities and dubs that ``only`` names.

    Raises:
        DubbingError: ``only`` names something the manifest does not have.
    """
    known = {*manifest.identities, *(dub.name for dub in manifest.dubs)}
    if unknown := [name for name in only if name not in known]:
        raise DubbingError(
            f"nothing is called {', '.join(unknown)}", "--only", f"there is {', '.join(known)}"
        )
    dubs = [d for d in manifest.dubs if not only or {d.name, d.identity} & set(only)]
    people = {
        name: identity
        for name, identity in manifest.identities.items()
        if not only or name in only or any(dub.identity == name for dub in dubs)
    }
    identities = {
        name: identity_job(manifest, name, identity, device) for name, identity in people.items()
    }
    return Jobs(
        identities, {d.name: dub_job(manifest, d, identities[d.identity], device) for d in dubs}
    )


def identity_job(manifest: Manifest, name: str, identity: Identity, device: str) -> Job:
    """Prepare, finetune and source check of one person."""
    folder = manifest.work / "identities" / name
    prepare = Stage(
        "prepare",
        folder / "prepared",
        VERSIONS["prepare"],
        {"clip": str(identity.clip), "size": identity.size},
        {"clip": identity.clip},
        steps.Prepare(identity),
    )
    base = identity.base or shipped_base(identity.preset)
    settings = {
        "start": identity.start,
        "seconds": identity.seconds,
        "preset": identity.preset,
        "seed": identity.seed,
        "speech": identity.speech,
        "iterations": steps.iterations_of(identity),
    }
    source = Stage(
        "source",
        folder / "source_sync",
        VERSIONS["source"],
        {},
        {"clip": identity.clip},
        steps.Check(identity.clip),
    )
    finetune = Stage(
        "finetune",
        folder / "model",
        VERSIONS["finetune"],
        settings,
        {
            "prepared": prepare,
            "source": source,
            **({"base": base} if base else {}),
            **speech_input(identity),
        },
        steps.Finetune(identity, prepare.folder, source.folder, base, device),
    )
    stages = {stage.name: stage for stage in (prepare, source, finetune)}
    return Job("identity", name, stages, blocked=manifest.damaged.get(identity.clip))


def dub_job(manifest: Manifest, dub: Dub, person: Job, device: str) -> Job:
    """Speech, heads, video and sync check of one dub."""
    damaged = manifest.damaged.get(dub.audio)
    if damaged or person.blocked:
        return Job("dub", dub.name, {}, dub.identity, damaged)
    identity = manifest.identities[dub.identity]
    clip, sound = manifest.media[identity.clip], manifest.media[dub.audio]
    assert clip.rate is not None  # a clip without a picture is no valid manifest
    folder = manifest.work / "dubs" / dub.name
    left = sound.sound_seconds - dub.audio_start
    seconds = min(left, dub.audio_seconds) if dub.audio_seconds else left
    cut = {"audio_start": dub.audio_start, "seconds": seconds}
    poses = {"video_start": dub.video_start, "on_longer_audio": dub.on_longer_audio}
    prepare, finetune = person.stages["prepare"], person.stages["finetune"]
    speech = Stage(
        "speech",
        folder / "speech",
        VERSIONS["speech"],
        {"name": identity.speech, "rate": str(clip.rate), **cut},
        {"audio": dub.audio, **speech_input(identity)},
        steps.Listen(dub, identity.speech, identity.speech_weights, clip.rate, seconds),
    )
    heads = Stage(
        "heads",
        folder / "heads",
        VERSIONS["heads"],
        poses,
        {"model": finetune, "prepared": prepare, "speech": speech},
        steps.Render(dub, finetune.folder, prepare.folder, speech.folder, device),
    )
    look = {"frame": dub.frame, "label": dub.label, "codec": dub.codec}
    # Nothing of the picture depends on it, but the record of a result says who agreed to it.
    consent = {"consent": identity.consent.model_dump(mode="json")}
    video = Stage(
        "video",
        folder / "video",
        VERSIONS["video"],
        {**look, "audio_rate": dub.audio_rate, **poses, **cut, **consent},
        {"heads": heads, "prepared": prepare, "clip": identity.clip, "audio": dub.audio},
        steps.Compose(dub, heads.folder, prepare.folder, speech.folder, seconds),
    )
    sync = Stage(
        "sync",
        folder / "sync",
        VERSIONS["sync"],
        {},
        {"video": video, "source": person.stages["source"]},
        steps.Check(video_file(video, dub), person.stages["source"].folder / steps.SYNC_FILE),
    )
    stages = {stage.name: stage for stage in (speech, heads, video, sync)}
    return Job("dub", dub.name, stages, dub.identity, _too_long(dub, clip, seconds))


def _too_long(dub: Dub, clip: Any, seconds: float) -> DubbingError | None:
    """With ``on_longer_audio: fail`` it is known beforehand that a dub cannot be made."""
    frames = timeline.frame_count(seconds, clip.rate)
    left = clip.frames - timeline.first_frame(dub.video_start, clip.rate)
    if dub.on_longer_audio != "fail" or frames <= left:
        return None
    return RenderingError(
        f"the speech lasts {frames} frames, the clip {left} from video_start on",
        dub.name,
        "set on_longer_audio to bounce, loop, hold or cut, or use a longer clip",
    )


def speech_input(identity: Identity) -> dict[str, Path]:
    """The weights of an identity's speech features, where they have any."""
    file = features.weights_file(identity.speech, identity.speech_weights)
    return {} if file is None else {"speech_weights": file}


def video_file(video: Stage, dub: Dub) -> Path:
    """The finished file in the folder of the video stage."""
    return video.folder / f"video{SUFFIX[dub.codec]}"
