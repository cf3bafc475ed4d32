"""Speech features of a cue, and the number of frames that it lasts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save
from typing_extensions import TypedDict

from dubbing.engine.disk import json_records
from dubbing.engine.disk.files import atomic_write_bytes, atomic_write_json
from dubbing.errors import RenderingError
from dubbing.script import timeline
from dubbing.sound_to_lips.speech_frames import SpeechFrames, at_moments, lips_of_file, styled
from dubbing.speech import features

TENSORS, SUMMARY = "features.safetensors", "speech.json"


class Summary(TypedDict):
    """Facts of speech that are kept beside its features."""

    name: str
    frames: int
    rate: Fraction
    seconds: float


@dataclass(frozen=True)
class Speech:
    """Features (T, D), voice activity (T,) and predicted lips (T, P) of F frames of speech.

    50 a second.
    """

    name: str
    frames: int
    rate: Fraction
    seconds: float
    features: np.ndarray
    voice: np.ndarray
    lips: np.ndarray

    @staticmethod
    def load(folder: Path) -> Speech:
        """Read what ``listen`` wrote.

        Raises:
            ExplainedError: its summary is something else.
        """
        summary = json_records.read(folder / SUMMARY, Summary, "speech", "run with --force listen")
        return Speech(**summary, **load_file(folder / TENSORS))

    def styled(self, style: str) -> Speech:
        """The same with lips in a style; see `speech_frames.styled`."""
        return replace(self, lips=styled(self.lips, style))

    def at(self, moments: np.ndarray) -> SpeechFrames:
        """Speech features at moments (F,) of the sound, in seconds; see `at_moments`."""
        return at_moments(self.features, self.lips, moments)


def listen(
    audio: Path,
    out: Path,
    *,
    name: str,
    weights: Path | None = None,
    rate: Fraction,
    start: float,
    seconds: float,
) -> None:
    """Write OUT/features.safetensors and OUT/speech.json.

    Args:
        audio: anything with sound.
        name: kind of speech features.
        weights: of the user's own for them.
        rate: frames a second of the dub.
        start, seconds: the part of the sound to speak.

    Raises:
        MediaError: the sound cannot be read.
        RenderingError: there is next to nothing of it.
    """
    kind = features.features_by_name(name, weights)
    found, voice = features.features_of_file(audio, kind, start=start, seconds=seconds)
    if not len(found):
        raise RenderingError(
            "no sound there", f"{audio.name} from {start:g} s", "change audio_start"
        )
    lips = lips_of_file(audio, start=start, seconds=seconds)
    tensors = {"features": found, "voice": voice, "lips": lips}
    atomic_write_bytes(
        out / TENSORS, save({k: np.ascontiguousarray(v) for k, v in tensors.items()})
    )
    frames = timeline.frame_count(seconds, rate)
    summary = {"name": name, "frames": frames, "rate": str(rate), "seconds": seconds}
    atomic_write_json(out / SUMMARY, summary)
