"""Speech features, 50 a second: the input of the model.

Letters: N samples at 16 kHz, T steps of 20 ms, D feature values, F video frames.
A new kind is a class with the members of `SpeechFeatures`, and a case of `features_by_name`.
"""

from pathlib import Path
from typing import Protocol

import numpy as np

from dfrf.config import PUBLISHED_SPEECH as DEEPSPEECH
from dubbing.engine.disk.files import digest_data, digest_file
from dubbing.errors import ExplainedError
from dubbing.speech import voice_activity as voice
from dubbing.speech.mel_features import MelFeatures
from dubbing.speech.weight_paths import DEEPSPEECH_GRAPH, DEFAULT_WEIGHTS, files_of
from dubbing.speech.weight_paths import weights_file as file_in_folder

RATE = voice.STEP_RATE
# The model takes 16 steps of 20 ms around each video frame.
WINDOW = 16


class SpeechFeatures(Protocol):
    """A kind of speech feature. 0 must mean silence: the ends of a sound are padded with it."""

    name: str
    dim: int

    def extract(self, samples: np.ndarray) -> np.ndarray:
        """Features (T, dim) float32 of a sound at 16 kHz, (N,)."""

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        """The same of a long sound that `blocks()` gives in blocks of any length."""


TRANSFORMERS, WITHOUT_WEIGHTS = ("hubert", "wav2vec2"), ("mel",)


def features_by_name(name: str, weights: Path | None = None) -> SpeechFeatures:
    """The kind of speech feature called `name`, with the user's own weights or the shipped ones.

    Raises:
        ExplainedError: there is none of that name, or its weights cannot be used.
    """
    # torch is loaded only where it is needed.
    if name == "mel":
        return MelFeatures()
    if name == "rnn":
        from dubbing.speech.rnn_features import RnnFeatures

        return RnnFeatures(weights or DEFAULT_WEIGHTS)
    if name in TRANSFORMERS:
        from dubbing.speech.transformer_features import TransformerFeatures

        return TransformerFeatures(name, _named(name, weights))
    if name == DEEPSPEECH:
        from dubbing.speech.deepspeech_features import DeepSpeechFeatures

        return DeepSpeechFeatures(_named(name, weights))
    known = ", ".join(sorted(("rnn", DEEPSPEECH, *TRANSFORMERS, *WITHOUT_WEIGHTS)))
    raise ExplainedError(f"unknown speech features {name!r}", remedy=f"choose one of: {known}")


def weights_file(name: str, weights: Path | None = None) -> Path | None:
    """The file that the features depend on; None for those without weights.

    Raises:
        ExplainedError: weights are needed and missing.
    """
    if name in WITHOUT_WEIGHTS:
        return None
    if name == "rnn":
        return weights or DEFAULT_WEIGHTS
    if name == DEEPSPEECH:
        return _named(name, weights)
    return file_in_folder(_named(name, weights), name)


def weights_files(name: str, weights: Path | None = None) -> dict[str, Path]:
    """All files that the features depend on, by name; see `weights_file`."""
    file = weights_file(name, weights)
    if file is None:
        return {}
    return files_of(file.parent) if weights is not None and weights.is_dir() else {"": file}


def fingerprint(name: str, weights: Path | None = None) -> str:
    """Digest of the weights, which checkpoints record; '' for features without."""
    file = weights_file(name, weights)
    if file is None:
        return ""
    if file.suffix != ".json":
        return digest_file(file)
    return digest_data({part: digest_file(path) for part, path in files_of(file.parent).items()})


def _named(name: str, weights: Path | None) -> Path:
    if weights is None:
        what = DEEPSPEECH_GRAPH if name == DEEPSPEECH else "the folder of a model"
        raise ExplainedError(
            f"{name} features need weights of your own",
            remedy=f"set speech_weights to {what}, or choose speech: rnn",
        )
    return weights


def windows(features: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Features around moments of the sound.

    Args:
        features: (T, D), 50 a second.
        moments: (F,) seconds, the middles of F video frames.

    Returns:
        (F, 16, D) float32: 16 steps of 20 ms centred on each moment. Interpolated between steps
        where the rate needs it; silence (0) before the first and after the last step.
    """
    # The middle of the frame lies between the eighth and the ninth value. At 25 fps it is an edge
    # of the 20 ms grid, so the values are the steps themselves.
    offsets = (np.arange(WINDOW) - (WINDOW - 1) / 2) / RATE
    return voice.at_times(features, moments[:, None] + offsets[None, :])


def features_of_file(
    path: Path, features: SpeechFeatures, *, start: float = 0.0, seconds: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Features (T, D) and voice activity (T,) of an audio file or of a video's audio.

    A long one is read in blocks: memory grows by the features only (58 MB an hour for mel).

    Raises:
        MediaError: the file is missing, unreadable or has no audio.
    """
    from dubbing import media

    blocks = media.sound_blocks(path, rate=voice.SAMPLE_RATE, start=start, seconds=seconds)
    return features.extract_blocks(blocks), voice.voice_activity_of_blocks(blocks)
