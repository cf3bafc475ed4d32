"""Path of the sync check's weights; a module without torch, so that naming them is fast."""

from pathlib import Path

from dubbing.face.weight_paths import FACE_WEIGHTS
from dubbing.sound_to_lips.paths import ENCODER_WEIGHTS, FILTER_WEIGHTS
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS, VOICE_DETECTOR

SYNC_WEIGHTS = Path(__file__).parents[1] / "weights.safetensors"
# All weights of the sync check, by name: its own, those that it hears with, and finds faces with.
CHECK_WEIGHTS: dict[str, Path] = {
    "sync_weights": SYNC_WEIGHTS,
    "acoustic_weights": DEFAULT_WEIGHTS,
    "voice_detector": VOICE_DETECTOR,
    "lip_encoder": ENCODER_WEIGHTS,
    "lip_filter": FILTER_WEIGHTS,
    **FACE_WEIGHTS,
}
