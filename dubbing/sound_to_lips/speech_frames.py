"""Speech at video frames: features for the model's speech code, and predicted lips."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dfrf.field.speaker_adaptation import PREDICTED
from dubbing import media
from dubbing.script.edit import STYLES
from dubbing.sound_to_lips.predict import predict
from dubbing.speech import features
from dubbing.speech import voice_activity as voice

ROUND_S = 0.16  # to both sides, of the mean of lips that a style goes by


@dataclass(frozen=True)
class SpeechFrames:
    """F frames of speech.

    Attributes:
        windows: (F, 16, D) speech features round each frame.
        lips: (F, P) predicted lips and sound features, see `dfrf.field.speaker_adaptation`.
    """

    windows: np.ndarray
    lips: np.ndarray

    def __post_init__(self) -> None:
        if len(self.windows) != len(self.lips):
            raise ValueError(f"{len(self.windows)} frames of speech, {len(self.lips)} of lips")

    def __len__(self) -> int:
        return len(self.windows)


def at_moments(speech_features: np.ndarray, lips: np.ndarray, moments: np.ndarray) -> SpeechFrames:
    """Speech at moments (F,) of the sound, in seconds, the middles of F frames.

    Args:
        speech_features: (T, D), 50 a second.
        lips: (T, P), 50 a second.
    """
    # Outside the audio the lips stay as at its ends: it is silent there, so they are closed.
    inside = np.clip(moments, 0.5 / voice.STEP_RATE, (len(lips) - 0.5) / voice.STEP_RATE)
    return SpeechFrames(features.windows(speech_features, moments), voice.at_times(lips, inside))


def styled(lips: np.ndarray, style: str) -> np.ndarray:
    """Predicted lips (T, P) in a style: nearer to their mean round each step, or further from it.

    Softer, they are that mean; clearer, twice as far from it. It is weighted by a triangle that
    ends `ROUND_S` to both sides.
    """
    if not STYLES[style]:
        return lips
    steps = round(ROUND_S * voice.STEP_RATE)
    weights = np.bartlett(2 * steps + 1)[1:-1]
    own, heard = np.split(lips, [PREDICTED], axis=1)
    padded = np.pad(own, ((steps - 1, steps - 1), (0, 0)), mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, len(weights), axis=0)
    mean = around @ (weights / weights.sum())
    return np.concatenate([own + STYLES[style] * (own - mean), heard], 1).astype(lips.dtype)


def lips_of_file(path: Path, *, start: float = 0.0, seconds: float | None = None) -> np.ndarray:
    """Predicted lips (T, P) of an audio file or of a video's audio, 50 a second.

    Raises:
        MediaError: the file is missing, unreadable or has no audio.
    """
    return predict(media.sound_blocks(path, rate=voice.SAMPLE_RATE, start=start, seconds=seconds))
