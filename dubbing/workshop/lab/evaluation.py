"""Held-out figures of every identity of a manifest, for one or several methods.

Protocol P15 compares pictures: own speech, pose and background of the held-out frames. P15x is the
case of a dub: their speech over pictures from elsewhere, see `dubbing.workshop.lab.cross_driving`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from dfrf import device as devices
from dfrf.checkpoint import CheckpointError
from dfrf.config import family
from dfrf.metrics import lpips
from dfrf.metrics.lpips import Lpips
from dubbing import json_records as kept
from dubbing import pipeline, tasks
from dubbing.batch.jobs import chosen_names
from dubbing.engine import claims
from dubbing.engine.stage import Stage
from dubbing.engine.update import run_stage
from dubbing.errors import DubbingError
from dubbing.files import atomic_write_json, remove_torn
from dubbing.identity.learned import SUMMARY_FILE
from dubbing.manifest.entries import Identity
from dubbing.manifest.manifest import Manifest
from dubbing.preparation.prepared import PreparedClip
from dubbing.stages.finetune import MODEL_FILE, clip_speech
from dubbing.workshop.lab import tiles
from dubbing.workshop.lab.cross_driving import measure_dub
from dubbing.workshop.lab.held_out import frames_to_test, supposed
from dubbing.workshop.lab.measuring import measure
from dubbing.workshop.lab.sync_figures import sync_figures

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
    "ad-nerf-nolips": "ad-nerf-nolips",
    "nerf": "nerf",
}
PROTOCOLS = {"p15": ("p15",), "p15x": ("p15x",), "both": ("p15", "p15x")}
# So many references, the same in every frame.
REFERENCES_OF_METHOD = {"dfrf-1": 1, "dfrf-2": 2, "dfrf-4": 4, "dfrf-6": 6}

FEWEST = 50  # frames of a protocol whose figures mean something: two seconds
Progress = Callable[[str, float], None]
Figures = dict[str, dict[str, dict[str, Any]]]  # identity -> method -> figure -> value


class Learned(TypedDict):
    """What is read of a fine-tune's summary."""

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
            -6 (so many references, the same in every frame), paper, ad-nerf, ad-nerf-nolips (its
            speech networks learn from pictures alone), nerf.
        only: names of identities or patterns; all when empty.
        protocol: p15, p15x or both.
        seconds: of the held-out part that are tested, its first; all when None.
        every: P15 renders and compares one frame of so many. With more than one, motion and lip
            sync are not measured; P15x always takes all frames.
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
    protocols = PROTOCOLS[protocol]
    names = [name for name in manifest.identities if name in chosen]
    for name in names:  # before anybody is learned
        frames_to_test(manifest, name, [supposed(manifest.identities[name])], seconds, protocols)
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
                    manifest, name, method, (seconds, protocols), every, network, device, notify
                )
                before = found.setdefault(name, {}).get(method, {})
                found[name][method] = merged(before, figures)
                atomic_write_json(path, found)
    return found


def few(figures: Mapping[str, Any]) -> dict[str, str]:
    """A sentence where so few frames were measured that their figures say next to nothing."""
    frames = figures.get("frames", FEWEST)
    if frames >= FEWEST:
        return {}
    why = f"measured: {frames:.0f}, and fewer than {FEWEST} say little of a person"
    return {"frames suspicion": f"{why}; hold out more, by fewer `seconds` or a longer clip"}


def merged(before: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """Figures just measured, with those of the other protocol that an earlier call left.

    Only of the same model: one that learned as many steps in exactly as many seconds.
    """
    if any(before.get(key) != now[key] for key in ("steps", "seconds")):
        return now
    pictures_too = not set(now) <= {"p15x", "steps", "seconds"}
    kept = {name: value for name, value in before.items() if (name == "p15x") == pictures_too}
    return {**kept, **now}


def learned_by(method: str, own: Identity) -> Identity:
    """An identity as a method learns it.

    A base of the identity's own serves its own family of presets, a number of references the
    method `dfrf`.
    """
    preset = PRESET_OF_METHOD[method]
    references = REFERENCES_OF_METHOD.get(
        method, own.finetune.references if method == "dfrf" else None
    )
    changed = {
        "preset": preset,
        "base": own.base if family(preset) == family(own.preset) else None,
        "finetune": own.finetune.model_copy(update={"references": references}),
    }
    return own.model_copy(update=changed)


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
        tested: seconds and protocols, see `frames_to_test`. every: one of so many, in P15.
    """
    own = manifest.identities[name]
    identity = learned_by(method, own)
    job = pipeline.identity_job(manifest, name, identity, device)
    prepare, source, finetune = (job.stages[n] for n in ("prepare", "check_source", "finetune"))
    needed = [read for read in finetune.inputs.values() if isinstance(read, Stage)]
    if (identity.preset, identity.finetune) != (own.preset, own.finetune):
        # The model of the dubs stays where it is.
        finetune = replace(finetune, folder=finetune.folder.with_name(f"model-{method}"))
    began = finetune.sources()
    for stage in (*needed, finetune):
        run_stage(stage, progress, began=began)
    clip = PreparedClip.load(prepare.folder, identity.clip)
    learned = kept.read(finetune.folder / SUMMARY_FILE, Learned, "summary of finetune")
    part = frames_to_test(manifest, name, learned["learned"], *tested)
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
        found |= few(found)
    if part.p15x:
        figures = measure_dub(
            *(model, clip, speech, part.p15x, part.learned, out / "p15x"),
            device=device,
            progress=progress,
        )
        sync = sync_figures(clip, out / "p15x", part.p15x[0])
        found["p15x"] = {**figures, **sync, **few(figures)}
    return {**found, "steps": learned["steps"], "seconds": learned["seconds"]}
