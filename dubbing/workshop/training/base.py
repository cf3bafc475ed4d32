"""Training the shared base checkpoint across the identities of a manifest."""

import csv
import io
import math
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from dfrf import checkpoint, presets, saved_models
from dfrf.data.dataset import HeadDataset
from dfrf.presets import method_of
from dfrf.training.fit import FitOptions, TrainingDivergedError, fit
from dfrf.training.progress import TrainingProgress
from dfrf.training.validation import Validation
from dubbing import pipeline, tasks
from dubbing.engine.update import run_stage
from dubbing.errors import CheckpointError, DubbingError, TrainingError
from dubbing.files import atomic_write_json, atomic_write_text, digest_file
from dubbing.identity.best_seconds import choose_frames
from dubbing.identity.dataset import load_identity
from dubbing.manifest.manifest import Manifest
from dubbing.preparation.prepared import PreparedClip
from dubbing.stages.curve import write_curve
from dubbing.stages.finetune import clip_speech
from dubbing.stages.initial_model import FinetuneSettings, init_from_base

MOST_FRAMES = 240  # of one identity: more show little that is new, and memory is finite


def train_base(
    manifest: Manifest,
    out: Path,
    *,
    device: str = "auto",
    iterations: int | None = None,
    init: Path | None = None,
    hold_out: tuple[str, ...] = (),
    progress: Callable[[str, float], None],
) -> None:
    """Writes OUT and, beside it, its curve (.csv) and its history (.json).

    With people held out, OUT is the model that served them best on the way (.held_out.csv), and
    training ends early once it no longer gets better.

    An interrupted run leaves its state in OUT.resume and is continued by the next call, with the
    same arguments. Preset, speech features and seed are those of the manifest's identities, which
    must agree in them.

    Args:
        manifest: `start` and `seconds` of each identity select what is learned of its clip.
        out: the checkpoint to write.
        device: auto, cpu or cuda.
        iterations: optimiser steps in all; three quarters of them without the warp, as the paper
            divides its 300k and 100k. The preset's by default.
        init: a base checkpoint to start from instead of random weights.
        hold_out: names of identities that are not learned from but measured on.
        progress: called with a message and the share done.

    Raises:
        DubbingError: an unknown name is held out, or nobody is left to learn from.
        TrainingError: the identities disagree, one has no usable frame, or the loss diverged.
        CheckpointError: `init` does not fit, or OUT.resume is of another run.
    """
    learned, unseen = learned_names(manifest, hold_out), sorted(set(hold_out))
    settings = common_settings(manifest)
    people, held = (
        [load_person(manifest, name, device, settings, progress) for name in names]
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
    validation = Validation(held)
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
                    "people": [person_key(manifest, name) for name in (*learned, *unseen)],
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


def person_key(manifest: Manifest, name: str) -> list[Any]:
    """What of an identity is learned or measured on: name, digest of the clip, and which part."""
    identity = manifest.identities[name]
    return [name, digest_file(identity.clip), identity.size, identity.start, identity.seconds]


def learned_names(manifest: Manifest, hold_out: tuple[str, ...]) -> list[str]:
    """Identities that are learned from, in the order of their names.

    Raises:
        DubbingError: an unknown name is held out, or nobody is left.
    """
    if unknown := [name for name in hold_out if name not in manifest.identities]:
        raise DubbingError(f"no identity is called {', '.join(unknown)}", "--hold-out")
    learned = sorted(set(manifest.identities) - set(hold_out))
    if not learned:
        raise DubbingError("everyone is held out", "--hold-out", "leave somebody to learn from")
    return learned


def write_validation(path: Path, validation: Validation) -> None:
    """Measurements on people held out as CSV: step, PSNR in dB of each of them."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["step", *validation.names])
    rows.writerows([int(step), *psnr] for step, *psnr in validation.rows)
    atomic_write_text(path, text.getvalue())


def common_settings(manifest: Manifest) -> FinetuneSettings:
    """Preset, seed and speech features that all identities share.

    Raises:
        TrainingError: they do not.
    """
    found = {
        FinetuneSettings(
            preset=i.preset,
            seed=i.seed,
            speech=i.speech,
            speech_weights=None if i.speech_weights is None else str(i.speech_weights),
        )
        for i in manifest.identities.values()
    }
    if len(found) != 1:
        raise TrainingError(
            "the identities differ in preset, seed or speech",
            manifest.path.name,
            "a base is trained with one of each: set them under defaults",
        )
    return found.pop()


def load_person(
    manifest: Manifest,
    name: str,
    device: str,
    settings: FinetuneSettings,
    progress: Callable[[str, float], None],
) -> HeadDataset:
    """Prepares an identity where that is not done yet, and loads what is learned from it."""
    identity = manifest.identities[name]
    job = pipeline.identity_job(manifest, name, identity, device)
    if job.blocked is not None:
        raise job.blocked
    prepare, source = job.stages["prepare"], job.stages["check_source"]
    for stage in (prepare, source):
        run_stage(stage, lambda message, share: progress(f"{name}: {message}", share))
    clip = PreparedClip.load(prepare.folder, identity.clip)
    offset = tasks.offset_of(source.folder)
    speech = clip_speech(clip, settings.speech, settings.weights, offset)
    footage = choose_frames([clip], [speech], identity.learned_start, identity.learned_seconds)
    every = max(1, math.ceil(len(footage[0].frames) / MOST_FRAMES))
    return load_identity(name, footage, every=every)
