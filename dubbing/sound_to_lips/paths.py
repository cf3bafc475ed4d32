"""Paths of the shipped weights; a module without torch, so that naming them is fast."""

from pathlib import Path

from dubbing.speech.features import weights_files
from dubbing.speech.weight_paths import VOICE_DETECTOR

ENCODER_WEIGHTS = Path(__file__).with_name("encoder.safetensors")
FILTER_WEIGHTS = Path(__file__).with_name("filter.safetensors")
LIP_WEIGHTS = {"lip_encoder": ENCODER_WEIGHTS, "lip_filter": FILTER_WEIGHTS}


def speech_weights(name: str, weights: Path | None) -> dict[str, Path]:
    """The weights that turn speech into features and lips, by name.

    Args:
        name: of the features; weights: the user's own for them.
    """
    own = {f"features {of}".strip(): path for of, path in weights_files(name, weights).items()}
    return {**own, **LIP_WEIGHTS, "voice_detector": VOICE_DETECTOR}
