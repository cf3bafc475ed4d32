"""The story of a dub: its stages, in their order, and what each needs.

    person:  prepare -> check_source -> finetune -> refine_poses
    dub:     listen -> render -> composite -> check

This is the one place that says so: the planner, the runner, the report and ``--force`` read it. A
stage is out of date when its parameters, a file that it reads, the result of a stage that it reads,
or the code that does the work changed. Paths do not count, contents do. Nothing here imports torch.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dubbing import timeline
from dubbing.engine.code_version import code_version
from dubbing.engine.graph import Job, Jobs
from dubbing.engine.stage import Produce, Stage
from dubbing.errors import DubbingError, RenderingError
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.manifest import Manifest, load
from dubbing.manifest.only import chosen_names
from dubbing.media import SUFFIX, MediaInfo
from dubbing.shipped.base import shipped_base
from dubbing.sound_to_lips.paths import ENCODER_WEIGHTS, FILTER_WEIGHTS
from dubbing.speech import features
from dubbing.stage_kinds import KINDS
from dubbing.stages import tasks


class _Stages:
    """The stages of one job, in one folder, as they are declared."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.declared: dict[str, Stage] = {}

    def add(
        self,
        name: str,
        task: Produce,
        reads: Mapping[str, Path | Stage],
        parameters: Mapping[str, Any] | None = None,
    ) -> Stage:
        """Declares the next stage: who does it, what it reads, and what else it depends on."""
        kind = KINDS[name]
        folder, version = self.folder / kind.folder, code_version(kind.module)
        self.declared[name] = Stage(name, folder, version, parameters or {}, reads, task)
        return self.declared[name]


def identity_job(manifest: Manifest, name: str, identity: Identity, device: str) -> Job:
    """What is made once for a person: prepared clip, source check, model, refined poses."""
    stages = _Stages(manifest.work / "identities" / name)
    clip, base = identity.clip, identity.base or shipped_base(identity.preset)
    prepare = stages.add(
        "prepare", tasks.Prepare(identity), {"clip": clip}, {"size": identity.size}
    )
    prepared = tasks.Prepared(prepare.folder, clip)
    check_source = stages.add("check_source", tasks.Check(clip), {"clip": clip})
    finetune = stages.add(
        "finetune",
        tasks.Finetune(identity, prepared, check_source.folder, base, device),
        {
            "prepared": prepare,
            "source": check_source,
            **({"base": base} if base else {}),
            **_speech_weights(identity),
        },
        {
            "start": identity.start,
            "seconds": identity.seconds,
            "preset": identity.preset,
            "seed": identity.seed,
            "speech": identity.speech,
            "iterations": tasks.iterations_of(identity),
        },
    )
    stages.add(
        "refine_poses",
        tasks.RefinePoses(finetune.folder, prepared, device),
        {"model": finetune, "prepared": prepare},
    )
    return Job("identity", name, stages.declared, blocked=manifest.damaged.get(clip))


def dub_job(
    manifest: Manifest, dub: Dub, person: Job, device: str, folder: Path | None = None
) -> Job:
    """What is made for one dub: speech features, heads, video, sync check.

    Args:
        folder: where its stages lie; named after the dub by default.
    """
    damaged = manifest.damaged.get(dub.audio)
    if damaged or person.blocked:
        return Job("dub", dub.name, {}, dub.identity, damaged)
    identity = manifest.identities[dub.identity]
    clip, sound = manifest.media[identity.clip], manifest.media[dub.audio]
    assert clip.rate is not None  # a clip without a picture is no valid manifest
    prepare, check_source, finetune, refine_poses = person.stages.values()
    prepared = tasks.Prepared(prepare.folder, identity.clip)
    left = sound.sound_seconds - dub.audio_start
    seconds = min(left, dub.audio_seconds) if dub.audio_seconds else left
    cut = {"audio_start": dub.audio_start, "seconds": seconds}
    frames = {"video_start": dub.video_start, "on_longer_audio": dub.on_longer_audio}
    stages = _Stages(folder or dub_folder(manifest, dub.name))
    listen = stages.add(
        "listen",
        tasks.Listen(dub, identity.speech, identity.speech_weights, clip.rate, seconds),
        {"audio": dub.audio, **_speech_weights(identity)},
        {"name": identity.speech, "rate": str(clip.rate), **cut},
    )
    render = stages.add(
        "render",
        tasks.Render(dub, finetune.folder, prepared, refine_poses.folder, listen.folder, device),
        {"model": finetune, "prepared": prepare, "poses": refine_poses, "speech": listen},
        frames,
    )
    composite = stages.add(
        "composite",
        tasks.Composite(dub, render.folder, prepared, listen.folder, seconds),
        {"heads": render, "prepared": prepare, "clip": identity.clip, "audio": dub.audio},
        {
            **{key: getattr(dub, key) for key in ("frame", "label", "codec", "audio_rate")},
            **frames,
            **cut,
            # No pixel depends on it, but the record of a result says who agreed to it.
            "consent": identity.consent.model_dump(mode="json"),
        },
    )
    stages.add(
        "check",
        tasks.Check(video_file(composite, dub), check_source.folder / tasks.SYNC_FILE),
        {"video": composite, "source": check_source},
    )
    return Job("dub", dub.name, stages.declared, dub.identity, _too_long(dub, clip, seconds))


def build(manifest: Manifest, *, only: tuple[str, ...] = (), device: str = "auto") -> Jobs:
    """The jobs of a manifest, or of those identities and dubs that ``only`` names.

    Args:
        only: names, or patterns of names as a shell's: ``shot1_*``.

    Raises:
        DubbingError: ``only`` names something the manifest does not have.
    """
    named = chosen_names(only, [*manifest.identities, *(dub.name for dub in manifest.dubs)])
    dubs = [d for d in manifest.dubs if {d.name, d.identity} & named]
    needed = {dub.identity for dub in dubs}
    identities = {
        name: identity_job(manifest, name, identity, device)
        for name, identity in manifest.identities.items()
        if name in named or name in needed
    }
    return Jobs(
        identities,
        {dub.name: _found(manifest, dub, identities[dub.identity], device) for dub in dubs},
    )


def job_of(path: Path, label: str, device: str) -> Job:
    """One job of a manifest again, in a process that knows its label alone; see `Job.label`.

    Raises:
        DubbingError: the manifest is wrong, or has no such job.
    """
    kind, _, name = label.partition("/")
    manifest = load(path, only=(name,))
    named = {dub.name: dub for dub in manifest.dubs} if kind == "dub" else manifest.identities
    if name not in named:
        raise DubbingError(f"the manifest has no {kind} {name}", str(path), "run it again")
    dub = named[name]
    whose = dub.identity if isinstance(dub, Dub) else name
    person = identity_job(manifest, whose, manifest.identities[whose], device)
    return _found(manifest, dub, person, device) if isinstance(dub, Dub) else person


def dub_folder(manifest: Manifest, name: str) -> Path:
    """Where the stages of a dub lie."""
    return manifest.work / "dubs" / name


def _found(manifest: Manifest, dub: Dub, person: Job, device: str) -> Job:
    """The job of a dub: where it lies under the name it had before, in the folder of that name."""
    job = dub_job(manifest, dub, person, device)
    folders = dub_folder(manifest, dub.name).parent
    if not job.stages or not folders.is_dir() or dub_folder(manifest, dub.name).exists():
        return job
    named = {other.name for other in manifest.dubs}
    for folder in sorted(p for p in folders.iterdir() if p.is_dir() and p.name not in named):
        renamed = dub_job(manifest, dub, person, device, folder)
        if not any(stage.changes() for stage in renamed.stages.values()):
            return renamed
    return job


def video_file(composite: Stage, dub: Dub) -> Path:
    """The finished file in the folder of the composite stage."""
    return composite.folder / f"video{SUFFIX[dub.codec]}"


def _speech_weights(identity: Identity) -> dict[str, Path]:
    """The weights of what hears an identity's speech: its features, and the lips of it."""
    file = features.weights_file(identity.speech, identity.speech_weights)
    own = {} if file is None else {"speech_weights": file}
    return {**own, "lip_encoder": ENCODER_WEIGHTS, "lip_filter": FILTER_WEIGHTS}


def _too_long(dub: Dub, clip: MediaInfo, seconds: float) -> DubbingError | None:
    """With ``on_longer_audio: fail`` it is known beforehand that a dub cannot be made."""
    assert clip.rate is not None
    frames = timeline.frame_count(seconds, clip.rate)
    left = clip.frames - timeline.first_frame(dub.video_start, clip.rate)
    if dub.on_longer_audio != "fail" or frames <= left:
        return None
    return RenderingError(
        f"the speech lasts {frames} frames, the clip {left} from video_start on",
        dub.name,
        "set on_longer_audio to bounce, loop, hold or cut, or use a longer clip",
    )
