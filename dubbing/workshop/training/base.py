"""Training the shared base checkpoint across the identities of a manifest."""

import csv
import io
import math
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dfrf import checkpoint, presets, saved_models
from dfrf.data.dataset import HeadDataset
from dfrf.presets import method_of
from dfrf.training.fit import FitOptions, TrainingDivergedError, fit
from dfrf.training.progress import TrainingProgress
from dfrf.training.validation import Validation
from dubbing.engine.disk.files import atomic_write_json, atomic_write_text, digest_file
from dubbing.engine.graph.stage import Progress
from dubbing.engine.running.update import run_stage
from dubbing.errors import CheckpointError, ExplainedError, TrainingError
from dubbing.heads.curve import write_curve
from dubbing.heads.fine_tuning import clip_speech
from dubbing.heads.initial_model import init_from_base
from dubbing.identity.best_seconds import choose_frames
from dubbing.identity.dataset import load_identity
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.pipeline import person_job
from dubbing.preparation.prepared import PreparedClip
from dubbing.production.production import Production
from dubbing.stages.check_source import CheckSource
from dubbing.stages.prepare import Prepare
from dubbing.sync.records import offset_of

MOST_FRAMES = 240  # of one identity: more show little that is new, and memory is finite


def train_base(
    production: Production,
    out: Path,
    *,
    device: str = "auto",
    iterations: int | None = None,
    init: Path | None = None,
    hold_out: tuple[str, ...] = (),
    preset: str | None = None,
    progress: Progress,
) -> None:
    """Writes OUT and, beside it, its curve (.csv) and its history (.json).

    With people held out, OUT is the model that served them best on the way (.held_out.csv), and
    training ends early once it no longer gets better.

    An interrupted run leaves its state in OUT.resume and is continued by the next call, with the
    same arguments. Preset, speech features and seed are those of the manifest's identities, which
    must agree in them.

    Args:
        production: `start` and `seconds` of each identity select what is learned of its clip.
        out: the checkpoint to write.
        device: auto, cpu or cuda.
        iterations: optimiser steps in all; three quarters of them without the warp, as the paper
            divides its 300k and 100k. The preset's by default.
        init: a base checkpoint to start from instead of random weights.
        hold_out: names of identities that are not learned from but measured on.
        preset: of the base; that of the manifest's identities when None.

    Raises:
        ExplainedError: an unknown name is held out, or nobody is left to learn from.
        TrainingError: the identities disagree, one has no usable frame, or the loss diverged.
        CheckpointError: `init` does not fit, or OUT.resume is of another run.
    """
    learned, unseen = learned_names(production, hold_out), sorted(set(hold_out))
    settings = common_settings(production)
    if preset is not None:
        settings = replace(settings, preset=preset)
    people, held = (
        [load_person(production, name, device, settings, progress) for name in names]
        for names in (learned, unseen)
    )
    model = init_from_base(init, settings)
    config = replace(presets.trainings(settings.preset).base, seed=settings.seed)
    if iterations is not None:
        config = replace(
            config, iterations=iterations, coarse_iterations=math.ceil(iterations * 3 / 4)
        )

    def notify(state: TrainingProgress) -> None:
        progress(str(state), state.step / state.iterations)

    resume = out.with_name(out.name + ".resume")
    validation = Validation(held, config.coarse_iterations)
    try:
        curve = fit(
            method_of(model),
            people,
            config,
            options=FitOptions(
                resume=str(resume),
                progress=notify,
                device=device,
                validation=validation,
                about={
                    **settings.speech_header(),
                    "people": [person_key(production, name) for name in (*learned, *unseen)],
                    "init": "" if init is None else digest_file(init),
                },
            ),
        )
    except TrainingDivergedError as error:
        raise TrainingError(str(error), out.name, "change the seed or the clips") from error
    except checkpoint.CheckpointError as error:
        raise CheckpointError(
            str(error),
            remedy="go on with the same people, --iterations, --hold-out and --init, or remove"
            f" {resume} to start afresh",
        ) from error
    header = {
        **settings.speech_header(),
        "steps": config.iterations,
        "identities": [p.name for p in people],
        "frames": sum(p.frames for p in people),
        "seconds": round(curve.seconds),
    }
    if held:
        step, *psnr = validation.rows[validation.best_row()]
        model.load_state_dict(validation.best)
        header |= {"steps": int(step), "held_out": dict(zip(validation.names, psnr, strict=True))}
        write_validation(out.with_suffix(".held_out.csv"), validation)
    saved_models.save_model(out, model.cpu(), header)
    write_curve(out.with_suffix(".csv"), curve)
    atomic_write_json(out.with_suffix(".json"), {**header, "train": asdict(config)})
    shutil.rmtree(resume)


def person_key(production: Production, name: str) -> list[Any]:
    """The part of an identity that is learned or measured on: name, clip and seconds."""
    person = production.people[name]
    return [name, digest_file(person.clip.path), person.size, person.start, person.seconds]


def learned_names(production: Production, hold_out: tuple[str, ...]) -> list[str]:
    """Identities that are learned from, in the order of their names.

    Raises:
        ExplainedError: an unknown name is held out, or nobody is left.
    """
    if unknown := [name for name in hold_out if name not in production.people]:
        raise ExplainedError(f"no identity is called {', '.join(unknown)}", "--hold-out")
    learned = sorted(set(production.people) - set(hold_out))
    if not learned:
        raise ExplainedError("everyone is held out", "--hold-out", "leave somebody to learn from")
    return learned


def write_validation(path: Path, validation: Validation) -> None:
    """Measurements on people held out as CSV: step, PSNR in dB of each of them."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["step", *validation.names])
    rows.writerows([int(step), *psnr] for step, *psnr in validation.rows)
    atomic_write_text(path, text.getvalue())


def common_settings(production: Production) -> FinetuneSettings:
    """Preset, seed and speech features that all identities share.

    Raises:
        TrainingError: they do not.
    """
    found = {
        FinetuneSettings(
            preset=own.preset, seed=own.seed, speech=own.speech, speech_weights=own.speech_weights
        )
        for own in (person.settings for person in production.people.values())
    }
    if len(found) != 1:
        raise TrainingError(
            "the identities differ in preset, seed or speech",
            production.manifest.name,
            "a base is trained with one of each: set them under defaults",
        )
    return found.pop()


def load_person(
    production: Production, name: str, device: str, settings: FinetuneSettings, progress: Progress
) -> HeadDataset:
    """Prepares an identity where that is not done yet, and loads what is learned from it."""
    person = production.people[name]
    job = person_job(person, production.work, device=device)
    if job.blocked is not None:
        raise job.blocked
    prepare, source = job.stage(Prepare), job.stage(CheckSource)
    for stage in (prepare, source):
        run_stage(stage, lambda message, share: progress(f"{name}: {message}", share))
    clip = PreparedClip.load(prepare.folder, person.clip.path)
    offset = offset_of(source.folder)
    speech = clip_speech(clip, settings.speech, settings.weights, offset)
    footage = choose_frames([clip], [speech], person.start, person.seconds)
    every = max(1, math.ceil(len(footage[0].frames) / MOST_FRAMES))
    return load_identity(name, footage, every=every)
