"""What lips do while a sound is heard, 50 times a second.

Letters: N samples at 16 kHz, T steps of 20 ms, F video frames, K = 7 lip measures.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch

from dubbing.sound_to_lips.network import CLOSED, LipNetwork
from dubbing.sound_to_lips.paths import DEFAULT_WEIGHTS
from dubbing.sound_to_lips.weights import load
from dubbing.speech import listening
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_weights import SpeechModel, load_model, outputs
from dubbing.speech.rnn_features import voice_gate
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS as ACOUSTIC_WEIGHTS

# Steps worked on at once, and how many more are looked at on each side.
PIECE, AROUND = 3000, 100


@dataclass(frozen=True)
class PredictedLips:
    """What a stranger's lips would do.

    Attributes:
        lips: (T, K) measures as of `dubbing.face.lip_measures`, of about mean 0 over speech.
        closed: (T,) a score that rises where the lips touch.
    """

    lips: np.ndarray
    closed: np.ndarray

    def table(self) -> np.ndarray:
        """Both side by side, (T, K + 1)."""
        return np.concatenate([self.lips, self.closed[:, None]], 1)


@lru_cache(maxsize=1)
def _networks() -> tuple[SpeechModel, LipNetwork]:
    return load_model(ACOUSTIC_WEIGHTS), load(DEFAULT_WEIGHTS)


@torch.no_grad()
def predict(blocks: voice.Blocks) -> PredictedLips:
    """Lips of a sound that `blocks()` gives in pieces of any length; called three times."""
    acoustic, network = _networks()
    spectra = listening.spectra_of(blocks())
    if not len(spectra):
        return PredictedLips(np.zeros((0, CLOSED), np.float32), np.zeros(0, np.float32))
    activations = listening.hear(acoustic.network, spectra, outputs)
    gate = voice_gate(voice.voice_activity_of_blocks(blocks))
    return lips_of(network, activations, gate)


@torch.no_grad()
def lips_of(network: LipNetwork, activations: np.ndarray, gate: np.ndarray) -> PredictedLips:
    """Lips of what the acoustic network heard, (T, S) with the voice (T,), in pieces."""
    made = []
    for begin in range(0, len(activations), PIECE):
        low, high = max(0, begin - AROUND), begin + PIECE + AROUND
        part = network(
            torch.from_numpy(activations[None, low:high]).float(),
            torch.from_numpy(gate[None, low:high]).float(),
        )[0]
        made.append(part[begin - low :][:PIECE].numpy())
    table = np.concatenate(made)
    return PredictedLips(table[:, :CLOSED], table[:, CLOSED])
