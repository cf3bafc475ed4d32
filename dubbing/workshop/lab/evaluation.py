"""Held-out figures of every identity of a manifest, for one or several methods.

Protocol P15 compares pictures: own speech, pose and background of the held-out frames. P15x is the
case of a dub: their speech over pictures from elsewhere, see `dubbing.workshop.lab.cross_driving`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from dfrf import device as devices
from dfrf.checkpoint import CheckpointError
from dubbing.batch.jobs import chosen_names
from dubbing.engine.disk import claims
from dubbing.engine.disk import json_records as kept
from dubbing.engine.disk.files import atomic_write_json, remove_torn
from dubbing.engine.graph.stage import Progress, Stage
from dubbing.engine.running.update import run_stage
from dubbing.errors import ExplainedError
from dubbing.heads.fine_tuning import clip_speech
from dubbing.identity.learned import MODEL_FILE, SUMMARY_FILE
from dubbing.pipeline import person_job
from dubbing.preparation.prepared import PreparedClip
from dubbing.production.production import Production
from dubbing.stages.check_source import CheckSource
from dubbing.stages.finetune import Finetune
from dubbing.stages.prepare import Prepare
from dubbing.sync.records import offset_of
from dubbing.workshop.lab import tiles
from dubbing.workshop.lab.composition import composition as measure_composition
from dubbing.workshop.lab.cross_driving import measure_dub
from dubbing.workshop.lab.held_out import frames_to_test, supposed
from dubbing.workshop.lab.measuring import measure
from dubbing.workshop.lab.metrics import lpips
from dubbing.workshop.lab.metrics.lpips import Lpips
from dubbing.workshop.lab.sync_figures import sync_figures
from dubbing.workshop.lab.variants import Variant

RESULT_FILE = "evaluate.json"
EVALUATION = "evaluation"  # folder of what is measured, in that of the stages
PROTOCOLS = {"p15": ("p15",), "p15x": ("p15x",), "both": ("p15", "p15x")}
COMPOSITION = "composition"
FEWEST = 50  # frames of a protocol whose figures mean something: two seconds
Figures = dict[str, dict[str, dict[str, Any]]]  # identity -> method -> figure -> value


class Learned(TypedDict):
    """The keys of a fine-tune's summary that are read."""

    steps: int
    seconds: float
    learned: list[tuple[float, float]]


def evaluate(
    production: Production,
    *,
    methods: tuple[Variant, ...] = (Variant(),),
    only: tuple[str, ...] = (),
    protocol: str = "both",
    composition: bool = False,
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
        production: its dubs are not needed.
        methods: with what is changed in each.
        only: names of identities or patterns; all when empty.
        protocol: p15, p15x or both.
        composition: whether it is measured, too, what the pixels of a dub are made of.
        seconds: of the held-out part that are tested, its first; all when None.
        every: P15 renders and compares one frame of so many. With more than one, motion and lip
            sync are not measured; P15x always takes all frames.
        lpips_weights: the weights of torchvision's AlexNet; LPIPS is not measured without.
        device: auto, cpu or cuda.

    Returns:
        identity -> method -> figure -> value: what the file then holds.

    Raises:
        ExplainedError: an unknown method, one that has no references or warp to change, an unknown
            identity or protocol, other weights, nothing held out, another evaluate.json, or a stage
            failed.
        LockedError: another run evaluates in the manifest's output.
    """
    for method in methods:
        method.check()
    chosen = chosen_names(only, list(production.people))
    if protocol not in PROTOCOLS:
        raise ExplainedError(
            f"no protocol is called {protocol}", "--protocol", f"there is {', '.join(PROTOCOLS)}"
        )
    protocols = PROTOCOLS[protocol] + ((COMPOSITION,) if composition else ())
    names = [name for name in production.people if name in chosen]
    for name in names:  # before anybody is learned
        person = production.people[name]
        frames_to_test(person, [supposed(person)], seconds, protocols)
    network = None
    if lpips_weights is not None:
        try:
            network = lpips.load(lpips_weights, devices.choose(device))
        except CheckpointError as error:
            raise ExplainedError(str(error), "--lpips-weights") from error
    path = production.output / RESULT_FILE
    found: Figures = {}
    if os.path.lexists(path):
        found = kept.read(path, Figures, "earlier figures", "move it away")
    with claims.hold(production.work / EVALUATION):
        remove_torn(path)
        for name in names:
            for method in methods:

                def notify(message: str, share: float, title: str = f"{name}, {method}") -> None:
                    progress(f"{title}: {message}", share)

                figures = evaluate_one(
                    production, name, method, (seconds, protocols), every, network, device, notify
                )
                before = found.setdefault(name, {}).get(str(method), {})
                found[name][str(method)] = merged(before, figures)
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
    pictures_too = not set(now) <= {"p15x", COMPOSITION, "steps", "seconds"}
    of_dubs = {"p15x", COMPOSITION}
    kept = {name: x for name, x in before.items() if name in of_dubs or not pictures_too}
    return {**kept, **now}


def evaluate_one(
    production: Production,
    name: str,
    method: Variant,
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
    own = production.people[name]
    person = method.of(own)
    job = person_job(person, production.work, device=device)
    prepare, source, finetune = (job.stage(kind) for kind in (Prepare, CheckSource, Finetune))
    if person.settings != own.settings:
        # The model of the dubs stays where it is.
        finetune = replace(finetune, folder=finetune.folder.with_name(f"finetune-{method}"))
    began = finetune.sources()
    for stage in (*(one for one in finetune.inputs.values() if isinstance(one, Stage)), finetune):
        run_stage(stage, progress, began=began)
    clip = PreparedClip.load(prepare.folder, person.clip.path)
    learned = kept.read(finetune.folder / SUMMARY_FILE, Learned, "summary of finetune")
    part = frames_to_test(person, learned["learned"], *tested)
    model = finetune.folder / MODEL_FILE
    offset = offset_of(source.folder)
    speech = clip_speech(clip, person.settings.speech, person.settings.weights, offset)
    out = production.work / EVALUATION / name / str(method)
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
        tiles.write_methods(out, clip, first, count, every)
        if every == 1:
            found |= sync_figures(clip, out, part.p15)
        else:
            found["every"] = every
        found |= few(found)
    if COMPOSITION in tested[1]:
        found[COMPOSITION] = measure_composition(
            *(model, clip, speech, part.p15x, part.learned), device=device, progress=progress
        )
    if "p15x" in tested[1]:
        figures = measure_dub(
            *(model, clip, speech, part.p15x, part.learned, out / "p15x"),
            device=device,
            progress=progress,
        )
        sync = sync_figures(clip, out / "p15x", part.p15x[0])
        found["p15x"] = {**figures, **sync, **few(figures)}
    return {**found, "steps": learned["steps"], "seconds": learned["seconds"]}
