"""What lips do while a sound is heard, 50 times a second.

Letters: T steps of 20 ms, K = 7 lip measures.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch

from dubbing.sound_to_lips.encoder import STEP, encode
from dubbing.sound_to_lips.network import CLOSED, OUTPUTS, LipNetwork
from dubbing.sound_to_lips.weights import load
from dubbing.speech import voice_activity as voice

LEVEL_DB = -20.0  # of the loud parts of what the encoder hears


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
def _network() -> LipNetwork:
    return load()


def gain_of(energy: np.ndarray) -> float:
    """What to multiply a sound by for the encoder, from the energy (T,) of its steps in dB."""
    level = voice.loudness_db(energy)
    return 10 ** ((LEVEL_DB - level) / 20) if level > voice.SILENCE_DB else 0.0


@torch.no_grad()
def predict(blocks: voice.Blocks) -> PredictedLips:
    """Lips of a sound that `blocks()` gives in pieces of any length; called twice."""
    network = _network()
    energy = voice.energy_db(blocks())
    if not len(energy):
        return PredictedLips(np.zeros((0, CLOSED), np.float32), np.zeros(0, np.float32))
    answers = network.filter(encode(network.encoder, blocks(), gain_of(energy))).numpy()
    middle = (np.arange(len(energy)) + 0.5) * voice.HOP
    steps = (np.arange(len(answers)) + 0.5) * STEP
    table = np.stack([np.interp(middle, steps, answers[:, k]) for k in range(OUTPUTS)], 1)
    table = table.astype(np.float32)
    return PredictedLips(table[:, :CLOSED], table[:, CLOSED])
