"""Training data of the acoustic network: sounds, phones, lips of synthesisers; a teacher's senones.

Built part by part into a folder; parts that are there already are kept.

Letters: N samples at 16 kHz, T steps of 20 ms, S = 126 senones, M = 7 lip channels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

from dubbing import media
from dubbing.engine.disk.files import atomic_path
from dubbing.engine.graph.stage import Progress
from dubbing.errors import TrainingError
from dubbing.speech.voice_activity import HOP, SAMPLE_RATE, STEP_RATE, steps
from dubbing.workshop.synthetic.visemes import CHANNELS, mouth_curves
from dubbing.workshop.training.speech import synthesis
from dubbing.workshop.training.speech.phones import UNKNOWN, classes_at_steps
from dubbing.workshop.training.speech.synthesis import Voice
from dubbing.workshop.training.speech.teacher import senone_posteriors
from dubbing.workshop.training.speech.texts import LANGUAGES, sentence

# Kept out of training, to measure what an unknown voice and an unknown language cost.
LEFT_OUT_VOICE = "kal16"
LEFT_OUT_LANGUAGE = "nl"
# Recordings of people are cut into utterances of this length.
CUT_SECONDS = 8


@dataclass(frozen=True)
class Utterance:
    """Samples (N,) int16; classes (T,) int8; lips (T, M) and senones (T, S) float16.

    Where phones are not known, the classes are UNKNOWN and the lips NaN.
    """

    samples: np.ndarray
    classes: np.ndarray
    lips: np.ndarray
    senones: np.ndarray


@dataclass(frozen=True)
class Part:
    """Utterances of one voice or one recording. `real`: of a person."""

    name: str
    real: bool
    utterances: list[Utterance]


@dataclass(frozen=True)
class Amounts:
    """Seconds of speech a voice: of each flite voice, espeak-ng language and festival voice."""

    flite: float = 600.0
    espeak: float = 75.0
    festival: float = 120.0


def training_voices(amounts: Amounts) -> list[tuple[Voice, float]]:
    """The voices this machine has, without those left out, and how long each one speaks.

    Raises:
        TrainingError: flite is not installed.
    """
    chosen = [(v, amounts.flite) for v in synthesis.FLITE_VOICES if v.name != LEFT_OUT_VOICE]
    if not synthesis.available(chosen[0][0]):
        raise TrainingError("flite is not installed", remedy="install the package flite")
    languages = [name for name in LANGUAGES if name != LEFT_OUT_LANGUAGE]
    chosen += [(synthesis.espeak_voice(name), amounts.espeak) for name in languages]
    chosen += [(v, amounts.festival) for v in synthesis.FESTIVAL_VOICES]
    return [(voice, seconds) for voice, seconds in chosen if synthesis.available(voice)]


def build_corpus(
    folder: Path, recordings: Sequence[Path], amounts: Amounts, seed: int, progress: Progress
) -> list[Part]:
    """Creates the parts that are missing in `folder` and reads all of them.

    Args:
        folder: of the corpus.
        recordings: sounds or videos of people, one each, for the teacher alone.
        amounts: how much each voice speaks.
        seed: of texts, rates and pitches.

    Raises:
        TrainingError: a synthesiser or the teacher is missing.
        MediaError: a recording cannot be read.
    """
    folder.mkdir(parents=True, exist_ok=True)
    voices = training_voices(amounts)
    total = len(voices) + len(recordings)
    parts = []
    for k, (voice, seconds) in enumerate(voices):
        progress(voice.label, k / total)
        file = folder / f"{voice.engine}-{voice.name}.safetensors"
        if not file.exists():
            save_part(file, spoken_part(voice, seconds, seed + k))
        parts.append(load_part(file, real=False))
    for k, path in enumerate(recordings, len(voices)):
        progress(path.name, k / total)
        file = folder / f"real-{path.stem}.safetensors"
        if not file.exists():
            save_part(file, recorded_part(path))
        parts.append(load_part(file, real=True))
    return parts


def spoken_part(voice: Voice, seconds: float, seed: int) -> list[Utterance]:
    """At least `seconds` of random sentences in a voice."""
    rng = np.random.default_rng(seed)
    utterances, length = [], 0.0
    while length < seconds:
        text = sentence(voice.language, rng, int(rng.integers(5, 15)))
        spoken = synthesis.speak(voice, text, rng)
        utterances.append(utterance(spoken))
        length += len(spoken.samples) / SAMPLE_RATE
    return utterances


def utterance(spoken: synthesis.Spoken) -> Utterance:
    """A spoken text, and the teacher's senones for it."""
    senones = senone_posteriors(spoken.samples).astype(np.float16)
    return replace(without_senones(spoken), senones=senones)


def without_senones(spoken: synthesis.Spoken) -> Utterance:
    """A spoken text without senones yet, (T, 0)."""
    count = steps(len(spoken.samples))
    classes = np.full(count, UNKNOWN)
    lips = np.full((count, len(CHANNELS)), np.nan)
    if spoken.phones is not None:
        classes = classes_at_steps(spoken.phones, count)
        lips = mouth_curves(spoken.phones, count, Fraction(STEP_RATE))
    return Utterance(
        as_int16(spoken.samples),
        classes.astype(np.int8),
        lips.astype(np.float16),
        np.zeros((count, 0), np.float16),
    )


def recorded_part(path: Path) -> list[Utterance]:
    samples = media.read_audio(path, rate=SAMPLE_RATE)
    senones = senone_posteriors(samples).astype(np.float16)
    pieces = max(1, round(len(samples) / (CUT_SECONDS * SAMPLE_RATE)))
    edges = np.linspace(0, len(senones), pieces + 1).astype(int)
    utterances = []
    for low, high in pairwise(edges):
        lips = np.full((high - low, len(CHANNELS)), np.nan, np.float16)
        sound = as_int16(samples[low * HOP : high * HOP])
        unknown = np.full(high - low, UNKNOWN, np.int8)
        utterances.append(Utterance(sound, unknown, lips, senones[low:high]))
    return utterances


def as_int16(samples: np.ndarray) -> np.ndarray:
    return np.round(np.clip(samples, -1, 1) * 32767).astype(np.int16)


def save_part(file: Path, utterances: Sequence[Utterance]) -> None:
    tensors = {
        "samples": np.concatenate([u.samples for u in utterances]),
        "lengths": np.array([len(u.samples) for u in utterances]),
        "classes": np.concatenate([u.classes for u in utterances]),
        "lips": np.concatenate([u.lips for u in utterances]),
        "senones": np.concatenate([u.senones for u in utterances]),
    }
    with atomic_path(file) as temporary:
        save_file(tensors, temporary)


def load_part(file: Path, *, real: bool) -> Part:
    tensors = load_file(file)
    sample_ends = np.cumsum(tensors["lengths"])
    step_ends = np.cumsum([steps(int(n)) for n in tensors["lengths"]])
    utterances = [
        Utterance(samples, classes, lips, senones)
        for samples, classes, lips, senones in zip(
            np.split(tensors["samples"], sample_ends[:-1]),
            *(np.split(tensors[k], step_ends[:-1]) for k in ("classes", "lips", "senones")),
            strict=True,
        )
    ]
    return Part(file.stem, real, utterances)
