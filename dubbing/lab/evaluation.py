"""Held-out figures of every identity of a manifest, for one or several methods.

Protocol P15 compares pictures: own speech, pose and background of the held-out frames. P15x is the
case of a dub: their speech over pictures from elsewhere, see `dubbing.lab.cross_driving`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from dfrf import device as devices
from dfrf.checkpoint import CheckpointError
from dfrf.config import family
from dfrf.metrics import lpips
from dfrf.metrics.lpips import Lpips
from dubbing import json_records as kept
from dubbing import media, pipeline
from dubbing.engine import claims
from dubbing.engine.stage import Stage
from dubbing.engine.update import run_stage
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json, remove_torn
from dubbing.identity.best_seconds import Part
from dubbing.lab import tiles
from dubbing.lab.cross_driving import measure_dub, unlearned
from dubbing.lab.measuring import held_out, measure
from dubbing.manifest.entries import Identity
from dubbing.manifest.manifest import Manifest
from dubbing.manifest.only import chosen_names
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.stage_kinds import SUMMARY_FILE
from dubbing.stages import tasks
from dubbing.stages.finetune import MODEL_FILE, clip_speech
from dubbing.sync.check import check

RESULT_FILE = "evaluate.json"
EVALUATION = "evaluation"  # folder of what is measured, in that of the stages
PRESET_OF_METHOD = {
    "dfrf": "fast",
    "dfrf-nowarp": "fast-nowarp",
    "dfrf-alone": "fast-alone",
    "dfrf-1": "fast",
    "dfrf-2": "fast",
    "dfrf-4": "fast",
    "dfrf-6": "fast",
    "paper": "paper",
    "ad-nerf": "ad-nerf",
    "nerf": "nerf",
}
PROTOCOLS = {"p15": ("p15",), "p15x": ("p15x",), "both": ("p15", "p15x")}
# So many references, the same in every frame.
REFERENCES_OF_METHOD = {"dfrf-1": 1, "dfrf-2": 2, "dfrf-4": 4, "dfrf-6": 6}

Progress = Callable[[str, float], None]
Figures = dict[str, dict[str, dict[str, Any]]]  # identity -> method -> figure -> value


class Learned(TypedDict):
    """What of a fine-tune's summary is shown."""

    steps: int
    seconds: float
    learned: list[tuple[float, float]]


def evaluate(
    manifest: Manifest,
    *,
    methods: tuple[str, ...] = ("dfrf",),
    only: tuple[str, ...] = (),
    protocol: str = "both",
    seconds: float | None = None,
    every: int = 1,
    lpips_weights: Path | None = None,
    device: str = "auto",
    progress: Progress,
) -> Figures:
    """Fine-tunes what is not up to date, renders what is held out of each clip and measures it.

    Figures of other identities and methods that an earlier call left in OUTPUT/evaluate.json stay;
    so do those of the other protocol, if they are of the same model.

    Args:
        manifest: its dubs are not needed.
        methods: dfrf (the `fast` preset), dfrf-nowarp, dfrf-alone (without a base), dfrf-1, -2, -4,
            -6 (so many references, the same in every frame), paper, ad-nerf, nerf.
        only: names of identities or patterns; all when empty.
        protocol: p15, p15x or both.
        seconds: of the held-out part that are tested, its first; all when None.
        every: P15 renders and compares one frame of so many. More than one says nothing of how the
            mouth moves nor of lip sync; P15x always takes all frames.
        lpips_weights: the weights of torchvision's AlexNet; LPIPS is not measured without.
        device: auto, cpu or cuda.
        progress: called with a message and the share done.

    Returns:
        identity -> method -> figure -> value: what the file then holds.

    Raises:
        DubbingError: an unknown method, identity or protocol, other weights, nothing held out,
            another evaluate.json, or a stage failed.
        LockedError: another run evaluates in the manifest's output.
    """
    if unknown := [m for m in methods if m not in PRESET_OF_METHOD]:
        raise DubbingError(
            f"no method is called {', '.join(unknown)}",
            "--method",
            f"there is {', '.join(PRESET_OF_METHOD)}",
        )
    chosen = chosen_names(only, list(manifest.identities))
    if protocol not in PROTOCOLS:
        raise DubbingError(
            f"no protocol is called {protocol}", "--protocol", f"there is {', '.join(PROTOCOLS)}"
        )
    asked = PROTOCOLS[protocol]
    names = [name for name in manifest.identities if name in chosen]
    for name in names:  # before anybody is learned
        tested_parts(manifest, name, [supposed(manifest.identities[name])], seconds, asked)
    network = None
    if lpips_weights is not None:
        try:
            network = lpips.load(lpips_weights, devices.choose(device))
        except CheckpointError as error:
            raise DubbingError(str(error), "--lpips-weights") from error
    path = manifest.output / RESULT_FILE
    found: Figures = {}
    if os.path.lexists(path):
        found = kept.read(path, Figures, "earlier figures", "move it away")
    with claims.hold(manifest.work / EVALUATION):
        remove_torn(path)
        for name in names:
            for method in methods:

                def notify(message: str, share: float, title: str = f"{name}, {method}") -> None:
                    progress(f"{title}: {message}", share)

                figures = evaluate_one(
                    manifest, name, method, (seconds, asked), every, network, device, notify
                )
                before = found.setdefault(name, {}).get(method, {})
                found[name][method] = merged(before, figures)
                atomic_write_json(path, found)
    return found


@dataclass(frozen=True)
class Tested:
    """Which frames of a clip are tested.

    Attributes:
        learned: frames that were learned from.
        p15: the part whose pictures are compared; None where they are not asked for.
        p15x: the parts whose speech is dubbed over other pictures; none where not asked for.
    """

    learned: list[Part]
    p15: Part | None
    p15x: list[Part]


def supposed(identity: Identity) -> tuple[float, float]:
    """From which second to which it learns; of the best only how many they are is known."""
    start = identity.learned_start or 0.0
    return start, start + identity.learned_seconds


def tested_parts(
    manifest: Manifest,
    name: str,
    learned: Sequence[tuple[float, float]],
    seconds: float | None,
    protocols: tuple[str, ...],
) -> Tested:
    """Frames of an identity's clip to test on, `seconds` of each protocol at most.

    Args:
        learned: from which second to which it was learned from.

    Raises:
        DubbingError: the clip is damaged, or nothing of it is held out.
    """
    identity = manifest.identities[name]
    if damaged := manifest.damaged.get(identity.clip):
        raise damaged
    clip = manifest.media[identity.clip]
    assert clip.rate is not None  # a clip without a picture is no valid manifest
    frames = [(round(a * clip.rate), round((b - a) * clip.rate)) for a, b in learned]
    others = unlearned(clip.frames, clip.rate, frames)
    if not others:
        raise DubbingError(
            f"nothing of the clip is held out beside {identity.learned_seconds:g} s",
            name,
            "learn fewer seconds, or use a longer clip",
        )
    return Tested(
        frames,
        held_out(clip.frames, clip.rate, others, seconds) if "p15" in protocols else None,
        unlearned(clip.frames, clip.rate, frames, seconds) if "p15x" in protocols else [],
    )


def merged(before: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """Figures just measured, with those of the other protocol that an earlier call left.

    Only of the same model: one that learned as many steps in exactly as many seconds.
    """
    if any(before.get(key) != now[key] for key in ("steps", "seconds")):
        return now
    pictures_too = not set(now) <= {"p15x", "steps", "seconds"}
    kept = {name: value for name, value in before.items() if (name == "p15x") == pictures_too}
    return {**kept, **now}


def with_references(finetune: Stage, count: int) -> Stage:
    """A fine-tune with another number of references than its preset's."""
    assert isinstance(finetune.produce, tasks.Finetune)
    return replace(
        finetune,
        parameters={**finetune.parameters, "references": count},
        produce=replace(finetune.produce, references=count),
    )


def evaluate_one(
    manifest: Manifest,
    name: str,
    method: str,
    tested: tuple[float | None, tuple[str, ...]],
    every: int,
    network: Lpips | None,
    device: str,
    progress: Progress,
) -> dict[str, Any]:
    """Figures of one identity and method; leaves a picture beside the methods measured so far.

    Args:
        tested: seconds and protocols, see `tested_parts`. every: one of so many, in P15.
    """
    preset = PRESET_OF_METHOD[method]
    own = manifest.identities[name]
    # A base of the identity's own serves its own family of presets.
    base = own.base if family(preset) == family(own.preset) else None
    identity = own.model_copy(update={"preset": preset, "base": base})
    job = pipeline.identity_job(manifest, name, identity, device)
    prepare, source, finetune = (job.stages[n] for n in ("prepare", "check_source", "finetune"))
    references = REFERENCES_OF_METHOD.get(method)
    if references is not None:
        finetune = with_references(finetune, references)
    if preset != own.preset or references is not None:
        # The model of the dubs stays where it is.
        finetune = replace(finetune, folder=finetune.folder.with_name(f"model-{method}"))
    began = finetune.sources()
    for stage in (prepare, source, finetune):
        run_stage(stage, progress, began=began)
    clip = PreparedClip.load(prepare.folder, identity.clip)
    learned = kept.read(finetune.folder / SUMMARY_FILE, Learned, "summary of finetune")
    part = tested_parts(manifest, name, learned["learned"], *tested)
    model = finetune.folder / MODEL_FILE
    speech = clip_speech(
        clip, identity.speech, identity.speech_weights, tasks.offset_of(source.folder)
    )
    out = manifest.work / EVALUATION / name / method
    found: dict[str, Any] = {}
    if part.p15 is not None:
        first, count = part.p15
        found = dict(
            measure(
                *(model, clip, speech, first, count, out),
                every=every,
                lpips=network,
                device=device,
                progress=progress,
            )
        )
        tiles.write_methods(out.parent, PRESET_OF_METHOD, method, clip, first, count, every)
        if every == 1:
            found |= sync_figures(clip, out, part.p15)
        else:
            found["every"] = every
    if part.p15x:
        figures = measure_dub(
            *(model, clip, speech, part.p15x, part.learned, out / "p15x"),
            device=device,
            progress=progress,
        )
        found["p15x"] = {**figures, **sync_figures(clip, out / "p15x", part.p15x[0])}
    return {**found, "steps": learned["steps"], "seconds": learned["seconds"]}


def sync_figures(clip: PreparedClip, out: Path, part: Part) -> dict[str, Any]:
    """Lip sync of OUT/render_picture.mp4 and of the source beside it, once they have their sound.

    Args:
        part: frames of the clip that were spoken in them.
    """
    start, length = (float(frames / clip.rate) for frames in part)
    checks = {}
    for kind in ("render", "source"):
        video = out / f"{kind}.mp4"
        picture = out / f"{kind}_picture.mp4"
        media.mux(
            picture,
            clip.clip,
            video,
            audio_start=start,
            seconds=length,
            metadata=provenance.tags() if kind == "render" else None,
        )
        picture.unlink()
        checks[kind] = check(video)
    render, source = checks["render"], checks["source"]
    return {
        "offset_frames": render.offset_frames,
        "confidence": render.confidence,
        "source_offset_frames": source.offset_frames,
        "source_confidence": source.confidence,
        **suspicion(render.confidence, source.confidence),
    }


def suspicion(confidence: float | None, of_source: float | None) -> dict[str, Any]:
    """`suspicious`, and a sentence where a render fits its sound better than the person does.

    Lips that do what speech sounds like on average please a sync network more than real ones.
    """
    if confidence is None or of_source is None:
        return {}
    if confidence <= of_source:
        return {"suspicious": False}
    why = (
        f"sync confidence {confidence:.3f} is above the source's own {of_source:.3f}: "
        "no success, lips of the average please a sync network more than a person's own"
    )
    return {"suspicious": True, "suspicion": why}
