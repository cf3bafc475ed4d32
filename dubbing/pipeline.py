"""The story of a dub: its stages, in their order, and what each needs.

    person:  prepare -> check_source -> finetune -> refine_poses
    dub:     listen -> render -> composite -> check (-> sign, with a certificate)

A dub of a scene has a ``listen`` and a ``render`` for each of its cues, in folders of their own, so
that one line can be made again without the others. The planner, the runner, the report and
``--force`` all read this one declaration. A stage is out of date when its parameters, a file or
another stage's result that it reads, or its code changed. Paths do not count, contents do.
Nothing here imports torch.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

from dubbing import tasks
from dubbing.engine.graph import Job
from dubbing.engine.stage import Stage
from dubbing.manifest.entries import Dub, Identity
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.provenance_checks import signer_of
from dubbing.media import SUFFIX
from dubbing.script.timeline import Cue
from dubbing.shipped.base import shipped_base
from dubbing.stages.kinds import SYNC_FILE
from dubbing.tasks.declaration import Stages, clip_name, stage_of
from dubbing.tasks.dependencies import (
    card_of,
    check_weights,
    composite_parameters,
    frames_of,
    mark_of,
    portraits_of,
    prepare_weights,
    signed_facts,
    sounds_of,
    speech_weights,
    too_long,
)

CUES = "cues"  # folder of the cues, in that of their dub


def identity_job(
    manifest: Manifest, name: str, identity: Identity, device: str, films: Iterable[Path] = ()
) -> Job:
    """What is made once for a person: prepared clip, source check, model, refined poses.

    Args:
        films: clips beside those that are learned from. All are prepared and checked, and have
            poses of their own, refined with the model.
    """
    stages = Stages(manifest.work / "identities" / name, "clips")
    clip, base = identity.clip, identity.base or shipped_base(identity.preset)
    made = {
        film: _prepared(manifest, stages, name, film, clip_name(identity, film))
        for film in dict.fromkeys((*identity.learned_clips, *films))
        if film == clip or film not in manifest.damaged
    }
    prepared = {film: tasks.Prepared(prepare.folder, film) for film, (prepare, _) in made.items()}
    learned = [(film, clip_name(identity, film)) for film in identity.learned_clips]
    finetune = stages.add(
        "finetune",
        tasks.Finetune(
            identity,
            tuple(prepared[film] for film, _ in learned),
            tuple(made[film][1].folder for film, _ in learned),
            base,
            device,
        ),
        reads={
            **{f"prepared {of}".strip(): made[film][0] for film, of in learned},
            **{f"source {of}".strip(): made[film][1] for film, of in learned},
            **({"base": base} if base else {}),
            **speech_weights(identity),
        },
        parameters={
            "start": identity.start,
            "seconds": identity.seconds,
            "preset": identity.preset,
            "seed": identity.seed,
            "speech": identity.speech,
            **identity.finetune.model_dump(exclude_none=True),
            "iterations": tasks.iterations_of(identity),
        },
    )
    for film, (prepare, _) in made.items():
        if film not in manifest.damaged and film in (clip, *films):
            stages.add(
                "refine_poses",
                tasks.RefinePoses(finetune.folder, prepared[film], device),
                reads={"model": finetune, "prepared": prepare},
                of=clip_name(identity, film),
            )
    return Job("identity", name, stages.declared, blocked=manifest.damaged.get(clip))


def _prepared(
    manifest: Manifest, stages: Stages, name: str, clip: Path, of: str
) -> tuple[Stage, Stage]:
    """A clip's preparation for a person, and the lip sync of the clip itself."""
    identity, people = manifest.identities[name], portraits_of(manifest, name, clip)
    portraits = {f"portrait {k}": person.clip for k, person in enumerate(people)}
    points = [[list(point) for point in person.points] for person in people]
    prepare = stages.add(
        "prepare",
        tasks.Prepare(identity, clip, people),
        reads={"clip": clip, **portraits, **prepare_weights()},
        parameters={"size": identity.size, **({"people": points} if people else {})},
        of=of,
    )
    reads = {"clip": clip, **check_weights()}
    return prepare, stages.add("check_source", tasks.Check(clip), reads=reads, of=of)


def dub_job(
    manifest: Manifest, dub: Dub, people: Mapping[str, Job], device: str, folder: Path | None = None
) -> Job:
    """What is made for one dub: speech features, heads, video, sync check.

    Args:
        people: the jobs of identities, by name.
        folder: where its stages lie; named after the dub by default.
    """
    scene = manifest.scenes.get(dub.name)
    if scene is None:
        return Job("dub", dub.name, {}, dub.people, manifest.blocked.get(dub.name))
    stages = Stages(folder or dub_folder(manifest, dub.name), CUES)
    heads = [_cue(manifest, dub, cue, people[cue.identity], stages, device) for cue in scene.cues]
    mark, card = mark_of(dub, scene), card_of(manifest, dub, scene)
    of_scene = scene if dub.lines is not None else None
    models = {f"model {name}": people[name].stages["finetune"] for name in dub.people}
    composite = stages.add(
        "composite",
        tasks.Composite(dub, scene, tuple(one for _, one in heads), mark, card),
        reads={
            **{f"heads {one.cue.name}": stage for stage, one in heads},
            **_clips(manifest, dub, people, scene.clip),
            **models,
            "clip": scene.clip,
            **sounds_of(dub, scene),
        },
        parameters=composite_parameters(manifest, dub, scene, mark, card),
    )
    first = dub.people[0]
    source = stage_of(people[first], "check_source", manifest.identities[first], scene.clip)
    finished_video, frames_of_card = video_file(composite, dub), card.frames if card else 0
    stages.add(
        "check",
        tasks.Check(finished_video, source.folder / SYNC_FILE, of_scene, frames_of_card),
        reads={"video": composite, "source": source, **check_weights()},
    )
    if signer := signer_of(dub):
        facts = signed_facts(manifest, dub, scene)
        folders = tuple(model.folder for model in models.values())
        stages.add(
            "sign",
            tasks.Sign(finished_video, signer, scene.clip, folders, facts),
            reads={
                "video": composite,
                **models,
                "clip": scene.clip,
                "certificate": signer.certificate,
                "key": signer.key,
            },
            parameters=facts,
        )
    return Job("dub", dub.name, stages.declared, dub.people, too_long(manifest, dub, scene))


def _cue(
    manifest: Manifest, dub: Dub, cue: Cue, person: Job, stages: Stages, device: str
) -> tuple[Stage, tasks.CueHeads]:
    """What is made for one cue: its speech features, and its heads."""
    clip = manifest.scenes[dub.name].clip
    identity, rate = manifest.identities[cue.identity], manifest.media[clip].rate
    finetune = person.stages["finetune"]
    prepare, refine_poses = (
        stage_of(person, kind, identity, clip) for kind in ("prepare", "refine_poses")
    )
    prepared = tasks.Prepared(prepare.folder, clip)
    of = "" if dub.lines is None else cue.name
    listen = stages.add(
        "listen",
        tasks.Listen(cue, identity.speech, identity.speech_weights, rate),
        reads={"audio": cue.audio, **speech_weights(identity)},
        parameters={
            "name": identity.speech,
            "rate": str(rate),
            "audio_start": cue.audio_start,
            "seconds": cue.seconds,
        },
        of=of,
    )
    work = tasks.Render(
        dub, cue, finetune.folder, prepared, refine_poses.folder, listen.folder, device
    )
    render = stages.add(
        "render",
        work,
        reads={"model": finetune, "prepared": prepare, "poses": refine_poses, "speech": listen},
        parameters=frames_of(dub) if dub.lines is None else {"first": cue.first, "stop": cue.stop},
        of=of,
        parts=work.parts(),
    )
    learned = tuple(
        tasks.Prepared(stage_of(person, "prepare", identity, film).folder, film)
        for film in identity.learned_clips
    )
    return render, tasks.CueHeads(cue, render.folder, prepared, learned, finetune.folder)


def _clips(manifest: Manifest, dub: Dub, people: Mapping[str, Job], film: Path) -> dict[str, Stage]:
    """The prepared clips that a dub reads: of the film, and of where people were learned."""
    named = {name: manifest.identities[name] for name in dub.people}
    prepared = {
        f"prepared {name}": stage_of(people[name], "prepare", identity, film)
        for name, identity in named.items()
    }
    learned = {
        f"learned {name} {clip_name(identity, clip)}".strip(): stage_of(
            people[name], "prepare", identity, clip
        )
        for name, identity in named.items()
        for clip in identity.learned_clips
        if clip != film
    }
    return {**prepared, **learned}


def dub_folder(manifest: Manifest, name: str) -> Path:
    """Where the stages of a dub lie."""
    return manifest.work / "dubs" / name


def video_file(made: Stage, dub: Dub) -> Path:
    """The finished file in the folder of the composite stage, or of the one that signs it."""
    return made.folder / f"video{SUFFIX[dub.codec]}"


def finished(job: Job, dub: Dub) -> Path:
    """The video of a dub as it goes out."""
    return video_file(job.stages.get("sign", job.stages["composite"]), dub)
