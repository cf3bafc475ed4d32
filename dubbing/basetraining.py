"""Training the shared base checkpoint across the identities of a manifest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch

from dfrf import checkpoint, presets
from dfrf.training import Progress, TrainingDivergedError, fit
from dubbing import features
from dubbing.errors import TrainingError
from dubbing.files import atomic_write_json
from dubbing.finetuning import RESUME_FOLDER, clip_windows, write_curve
from dubbing.identity import load_identity
from dubbing.preparation.prepared import PreparedClip

MOST_FRAMES = 240  # of one identity: more show little that is new, and memory is finite


@dataclass(frozen=True)
class Material:
    """A person to learn from: a prepared clip and the seconds of it to use."""

    name: str
    prepared: Path
    start: float
    seconds: float


def train_base(
    material: Sequence[Material],
    out: Path,
    *,
    preset: str = "fast",
    speech: str = "mel",
    iterations: int = presets.BASE_TRAINING.iterations,
    coarse_iterations: int | None = None,
    seed: int = 0,
    device: str = "auto",
    progress: Callable[[Progress], None] | None = None,
) -> None:
    """Writes OUT/base.safetensors, OUT/loss.csv and OUT/base.json; resumes from OUT/resume.

    Args:
        material: one entry an identity.
        out: folder; what an interrupted run left there is continued.
        preset: sizes of the model.
        speech: name of the speech features.
        iterations: optimiser steps in all.
        coarse_iterations: steps of the first stage, without warp; three quarters by default, as
            the paper divides them (300k and 100k).
        seed: of weights and rays.
        device: auto, cpu or cuda.
        progress: called after every step.

    Raises:
        TrainingError: an identity has no usable frame, or the loss diverged.
    """
    kind = features.features_by_name(speech)
    torch.manual_seed(seed)
    model = presets.build(presets.model_config(preset, kind.dim))
    people = []
    for part in material:
        clip = PreparedClip.load(part.prepared)
        count = round(part.seconds * clip.rate)
        windows = clip_windows(clip, speech)
        every = max(1, -(-min(count, clip.frames_count) // MOST_FRAMES))
        people.append(
            load_identity(
                part.name, part.prepared, windows, round(part.start * clip.rate), count, every
            )
        )
    config = replace(
        presets.BASE_TRAINING,
        iterations=iterations,
        coarse_iterations=iterations * 3 // 4 if coarse_iterations is None else coarse_iterations,
        seed=seed,
    )
    try:
        curve = fit(
            model,
            people,
            config,
            resume=str(out / RESUME_FOLDER),
            progress=progress,
            device=device,
        )
    except TrainingDivergedError as error:
        raise TrainingError(
            str(error), out.name, "lower the learning rate or change the seed"
        ) from error
    header = {
        "speech": speech,
        "steps": iterations,
        "identities": [p.name for p in people],
        "frames": sum(p.frames for p in people),
        "seconds": round(curve.seconds),
    }
    checkpoint.save_model(out / "base.safetensors", model.cpu(), header)
    write_curve(out / "loss.csv", curve)
    atomic_write_json(out / "base.json", {**header, "train": asdict(config)})
