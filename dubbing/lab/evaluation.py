"""Held-out figures of every identity of a manifest, for one or several methods (protocol P15)."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from dfrf import device as devices
from dfrf.checkpoint import CheckpointError
from dfrf.config import family
from dfrf.metrics import lpips
from dfrf.metrics.lpips import Lpips
from dubbing import jobs, media
from dubbing.engine import lock
from dubbing.engine import stage as stages
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json
from dubbing.lab import tiles
from dubbing.lab.measuring import held_out, measure
from dubbing.manifest.manifest import Manifest
from dubbing.preparation.prepared import PreparedClip
from dubbing.provenance import provenance
from dubbing.stages import steps
from dubbing.stages.finetune import MODEL_FILE, SUMMARY_FILE, clip_windows
from dubbing.sync.check import check

RESULT_FILE = "evaluate.json"
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
# So many references, the same in every frame.
REFERENCES_OF_METHOD = {"dfrf-1": 1, "dfrf-2": 2, "dfrf-4": 4, "dfrf-6": 6}

Progress = Callable[[str, float], None]


def evaluate(
    manifest: Manifest,
    *,
    methods: tuple[str, ...] = ("dfrf",),
    only: tuple[str, ...] = (),
    seconds: float | None = None,
    lpips_weights: tuple[Path, ...] = (),
    device: str = "auto",
    progress: Progress,
) -> dict[str, dict[str, dict[str, Any]]]:
    """Fine-tunes what is not up to date, renders the held-out end of each clip and measures it.

    Figures of other identities and methods that an earlier call left in OUTPUT/evaluate.json stay.

    Args:
        manifest: its dubs are not needed.
        methods: dfrf (the `fast` preset), dfrf-nowarp, dfrf-alone (without a base), dfrf-1, -2, -4,
            -6 (so many references, the same in every frame), paper, ad-nerf, nerf.
        only: names of identities; all when empty.
        seconds: of the held-out part that are tested, its first; all when None.
        lpips_weights: files with the published weights of LPIPS; not measured when empty.
        device: auto, cpu or cuda.
        progress: told a message and the share done.

    Returns:
        identity -> method -> figure -> value: what the file then holds.

    Raises:
        DubbingError: an unknown method or identity, other weights, nothing held out, or a stage
            failed.
        LockedError: another run works in the manifest's output.
    """
    if unknown := [m for m in methods if m not in PRESET_OF_METHOD]:
        raise DubbingError(
            f"no method is called {', '.join(unknown)}",
            "--method",
            f"there is {', '.join(PRESET_OF_METHOD)}",
        )
    if unknown := [name for name in only if name not in manifest.identities]:
        raise DubbingError(f"no identity is called {', '.join(unknown)}", "--only")
    parts = {name: tested_part(manifest, name, seconds) for name in only or manifest.identities}
    network = None
    if lpips_weights:
        try:
            network = lpips.load(lpips_weights, devices.choose(device))
        except CheckpointError as error:
            raise DubbingError(str(error), "--lpips-weights") from error
    path = manifest.output / RESULT_FILE
    found: dict[str, dict[str, dict[str, Any]]] = {}
    if path.is_file():
        found = json.loads(path.read_text(encoding="utf-8"))
    with lock.hold(manifest.work):
        for name, part in parts.items():
            for method in methods:

                def told(message: str, share: float, title: str = f"{name}, {method}") -> None:
                    progress(f"{title}: {message}", share)

                figures = evaluate_one(manifest, name, method, part, network, device, told)
                found.setdefault(name, {})[method] = figures
                atomic_write_json(path, found)
    return found


def tested_part(manifest: Manifest, name: str, seconds: float | None) -> tuple[int, int]:
    """First frame and number of frames of an identity's clip to test on, `seconds` at most.

    Raises:
        DubbingError: the clip is damaged, or nothing of it is held out.
    """
    identity = manifest.identities[name]
    if damaged := manifest.damaged.get(identity.clip):
        raise damaged
    clip = manifest.media[identity.clip]
    assert clip.rate is not None  # a clip without a picture is no valid manifest
    learned_to = identity.start + identity.seconds
    first, count = held_out(clip.frames, clip.rate, learned_to, seconds)
    if count <= 0:
        raise DubbingError(
            f"nothing of the clip is held out after {learned_to:g} s",
            name,
            "learn fewer seconds, or use a longer clip",
        )
    return first, count


def with_references(finetune: stages.Stage, count: int) -> stages.Stage:
    """A fine-tune with another number of references than its preset's."""
    assert isinstance(finetune.produce, steps.Finetune)
    return replace(
        finetune,
        parameters={**finetune.parameters, "references": count},
        produce=replace(finetune.produce, references=count),
    )


def evaluate_one(
    manifest: Manifest,
    name: str,
    method: str,
    part: tuple[int, int],
    network: Lpips | None,
    device: str,
    progress: Progress,
) -> dict[str, Any]:
    """Figures of one identity and method; leaves a picture beside the methods measured so far.

    Args:
        part: first frame and number of frames to test on; see `tested_part`.
    """
    preset = PRESET_OF_METHOD[method]
    own = manifest.identities[name]
    # A base of the identity's own serves its own family of presets.
    base = own.base if family(preset) == family(own.preset) else None
    identity = own.model_copy(update={"preset": preset, "base": base})
    job = jobs.identity_job(manifest, name, identity, device)
    prepare, source, finetune = (job.stages[n] for n in ("prepare", "source", "finetune"))
    references = REFERENCES_OF_METHOD.get(method)
    if references is not None:
        finetune = with_references(finetune, references)
    if preset != own.preset or references is not None:
        # The model of the dubs stays where it is.
        finetune = replace(finetune, folder=finetune.folder.with_name(f"model-{method}"))
    for stage in (prepare, source, finetune):
        stages.run(stage, progress)
    clip = PreparedClip.load(prepare.folder)
    first, count = part
    out = manifest.work / "evaluation" / name / method
    means = measure(
        finetune.folder / MODEL_FILE,
        prepare.folder,
        clip_windows(
            clip, identity.speech, identity.speech_weights, steps.offset_of(source.folder)
        ),
        first,
        count,
        out,
        lpips=network,
        device=device,
        progress=progress,
    )
    tiles.write_methods(out.parent, PRESET_OF_METHOD, method, clip, first, count)
    start, length = float(first / clip.rate), float(count / clip.rate)
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
    learned = json.loads((finetune.folder / SUMMARY_FILE).read_text(encoding="utf-8"))
    return {
        **means,
        "offset_frames": checks["render"].offset_frames,
        "confidence": checks["render"].confidence,
        "source_offset_frames": checks["source"].offset_frames,
        "source_confidence": checks["source"].confidence,
        "steps": learned["steps"],
        "seconds": learned["seconds"],
    }
