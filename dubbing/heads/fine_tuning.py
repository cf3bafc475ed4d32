"""Fine-tuning one person from the shared base checkpoint."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from dfrf import checkpoint, presets, saved_models
from dfrf.config import TrainConfig
from dfrf.data.dataset import HeadDataset
from dfrf.method_interface import Method
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dfrf.training.fit import FitOptions, TrainingDivergedError, fit
from dfrf.training.progress import Curve, TrainingProgress
from dubbing import media
from dubbing.engine.disk.files import atomic_write_json
from dubbing.errors import TrainingError
from dubbing.heads.curve import write_curve, write_events
from dubbing.heads.hand_cut import without_hands
from dubbing.heads.initial_model import init_from_base, training_settings
from dubbing.heads.pose_refinement import refined
from dubbing.identity.best_seconds import choose_frames, parts_of
from dubbing.identity.clip_frames import ClipFrames, with_turned
from dubbing.identity.dataset import lip_points, load_identity
from dubbing.identity.finetune_settings import FinetuneSettings
from dubbing.identity.learned import CURVE_FILE, MODEL_FILE, SUMMARY_FILE
from dubbing.identity.reference_choice import choose_references, turns_far
from dubbing.media.reading.voice_channel import is_silent
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames, at_moments, lips_of_file
from dubbing.speech import features

RESUME_FOLDER = "resume"
PICTURES_FOLDER = "pictures"  # in it: what is learned from, so that a long clip needs no memory
SOUND_BESIDE = 2.0  # s, heard before and after a part of a clip
POSING = 0.25  # of the steps: then the model knows the head well enough to refine its poses


def finetune(
    films: Sequence[tuple[PreparedClip, int]],
    out: Path,
    *,
    start: float | None,
    seconds: float,
    settings: FinetuneSettings,
    base: Path | None,
    device: str = "auto",
    progress: Callable[[TrainingProgress], None] | None = None,
) -> None:
    """Writes OUT/model.safetensors, OUT/finetune.json and the curve, see `dubbing.heads.curve`.

    Until then OUT/resume holds the state, from which the next call goes on, and the pictures.

    Args:
        films: what `prepare` made of each of the person's clips to learn from, and the frames by
            which its sound comes early; see `clip_speech`. Camera and face shape of the model are
            those of the first.
        out: folder; what an interrupted run left there is continued.
        start, seconds: see `choose_frames`.
        base: checkpoint to start from; None starts from random weights.
        device: auto, cpu or cuda.
        progress: called after every step.

    Raises:
        TrainingError: no face in that part, no sound, or the loss diverged.
        CheckpointError: the base does not fit.
    """
    clips = [clip for clip, _ in films]
    speeches = [
        clip_speech(clip, settings.speech, settings.weights, offset) for clip, offset in films
    ]
    chosen = choose_frames(clips, speeches, start, seconds)
    footage = [without_hands(one) for one in (with_turned(chosen) if settings.turned else chosen)]
    pictures = out / RESUME_FOLDER / PICTURES_FOLDER
    person = load_identity(clips[0].clip.stem, footage, folder=pictures)
    model = init_from_base(base, settings)
    trainings = presets.trainings(settings.preset)
    steps = settings.steps(from_base=base is not None, turned=turns_far(person))
    config = training_settings(
        settings, trainings.from_scratch if base is None else trainings.finetune, steps
    )
    method = method_of(model)
    landmarks = np.concatenate([one.landmarks(clips[0]) for one in footage])
    references = reference_frames(person, landmarks, method)
    try:
        person, curve = learn(
            model, person, footage, config, references, out / RESUME_FOLDER, device, progress
        )
    except TrainingDivergedError as error:
        raise TrainingError(
            str(error), person.name, "lower the learning rate or change the seed"
        ) from error
    views = None if references is None else method.reference_views(person, references)
    method.finish(person, views, config.seed)
    header = {
        **settings.speech_header(),
        "steps": config.iterations,
        "settings": asdict(settings),
        "clip": clips[0].clip.name,
    }
    saved_models.save_person(out / MODEL_FILE, model.cpu(), views, header)
    write_curve(out / CURVE_FILE, curve)
    write_events(out, curve)
    learned, *beside = [learned_parts(one, one.frames) for one in chosen]
    turned = [
        learned_parts(one, np.setdiff1d(one.frames, of.frames))
        for one, of in zip(footage, chosen, strict=True)
    ]
    summary = {
        "train": asdict(config),
        "frames": person.frames,
        "seconds": curve.seconds,
        "learned": learned,
        "beside": [[c.clip.name, parts] for c, parts in zip(clips[1:], beside, strict=True)],
        "turned": turned,
    }
    atomic_write_json(out / SUMMARY_FILE, {**header, **summary})
    shutil.rmtree(out / RESUME_FOLDER)


def learn(
    model: HeadModel,
    person: HeadDataset,
    footage: Sequence[ClipFrames],
    config: TrainConfig,
    references: torch.Tensor | None,
    resume: Path,
    device: str,
    progress: Callable[[TrainingProgress], None] | None,
) -> tuple[HeadDataset, Curve]:
    """Trains a person's model in place: some steps, then the poses they refine, then the rest.

    Args:
        footage: that the person's pictures are of.
        config: of all steps together.
        references: reference frames of the person.
        resume: folder for the state.

    Returns:
        The person with the poses that were learned with, and the curve of all steps.

    Raises:
        TrainingDivergedError: see `fit`.
    """
    curve = Curve()

    def part(folder: Path, steps: TrainConfig) -> None:
        done, before = len(curve.rows), curve.seconds
        if checkpoint.state_is_damaged(folder):
            shutil.rmtree(folder)

        def notify(state: TrainingProgress) -> None:
            if progress is not None:
                progress(state.within(done, config.iterations))

        made = fit(
            method_of(model),
            [person],
            steps,
            references=None if references is None else {person.name: references},
            options=FitOptions(resume=str(folder), progress=notify, device=device),
        )
        for step, loss, psnr, seconds in made.rows:
            curve.add(done + step, loss, psnr, before + seconds)

    first = round(POSING * config.iterations) if method_of(model).refines_poses else 0
    if first:
        part(resume / "posing", presets.with_iterations(config, first))
        method = method_of(model)
        maps = (
            None if references is None else method.maps(method.reference_views(person, references))
        )
        method.bake_for_poses(person, maps)
        clips = [(refined(model, maps, one.clip, one.with_face), one.with_face) for one in footage]
        posed = np.concatenate([clip.c2w()[frames] for clip, frames in clips])
        person = replace(
            person,
            c2w=torch.from_numpy(posed).float(),
            # Where lips are in a head is told by its pose.
            lip_points=torch.cat([lip_points(clip, frames) for clip, frames in clips]),
        )
    rest = presets.with_iterations(config, config.iterations - first)
    # Speech is learned once, and coarse steps come first.
    part(resume, rest if not first else replace(rest, coarse_iterations=0, lip_iterations=0))
    return person, curve


def learned_parts(footage: ClipFrames, frames: np.ndarray) -> list[tuple[float, float]]:
    """From which second to which of its clip some frames (F,) are."""
    rate = float(footage.clip.rate)
    return [(first / rate, (first + n) / rate) for first, n in parts_of(frames)]


def clip_speech(
    clip: PreparedClip, speech: str, weights: Path | None = None, offset: int = 0
) -> SpeechFrames:
    """Speech features of every frame of a clip, from its own audio; of frames beside its part
    those at its ends.

    Args:
        offset: frames by which the sound comes early: what belongs to frame i is heard at
            frame i - offset. A person learned with it is dubbed in sync.

    Raises:
        TrainingError: the clip has no sound, or a silent one.
    """
    info = media.probe(clip.clip)
    if info.audio_rate is None or is_silent(info, 0.0, info.sound_seconds):
        none = "has no sound" if info.audio_rate is None else "is silent"
        raise TrainingError(
            f"{none}, so there is nothing to learn the mouth from",
            clip.clip.name,
            "use a clip of the person speaking, with its sound",
        )
    kind, rate = features.features_by_name(speech, weights), float(clip.rate)
    start, seconds = 0.0, None
    if clip.part != (0, clip.frames_count):
        start = max(0.0, clip.part[0] / rate - SOUND_BESIDE)
        seconds = clip.part[1] / rate + SOUND_BESIDE - start
    heard, _ = features.features_of_file(clip.clip, kind, start=start, seconds=seconds)
    lips = lips_of_file(clip.clip, start=start, seconds=seconds)
    middles = (np.arange(clip.frames_count) - offset + 0.5) / rate - start
    return at_moments(heard, lips, middles)


def reference_frames(
    person: HeadDataset, landmarks: np.ndarray, method: Method[Any, Any]
) -> torch.Tensor | None:
    """Which frames are a person's references; None for a method without references.

    Their landmarks (T, 478, 2) are in pixels. As many as a frame looks at, all of them the same for
    every frame; more to choose the nearest from where the head turns far.
    """
    if not method.references:
        return None
    count = method.reference_pool_size if turns_far(person) else method.references
    return choose_references(person, landmarks, count)
