"""Speech features of our recurrent network: the words spoken, with little of the speaker."""

from pathlib import Path

import numpy as np
from scipy.ndimage import convolve1d, maximum_filter1d

from dubbing.speech import acoustic_inference
from dubbing.speech import voice_activity as voice
from dubbing.speech.acoustic_weights import load_model
from dubbing.speech.weight_paths import DEFAULT_WEIGHTS

# Voice is held this many steps each way, and faded over as many around the end of that.
HOLD, FADE = 6, 4
# Steps with less voice than this count as none.
_LEAST_VOICE = 0.1


class RnnFeatures:
    """Outputs of the acoustic network minus those of silence; exactly 0 where nobody speaks."""

    name = "rnn"

    def __init__(self, weights: Path = DEFAULT_WEIGHTS) -> None:
        self._model = load_model(weights)
        self.dim = self._model.dim

    def extract(self, samples: np.ndarray) -> np.ndarray:
        return self.extract_blocks(lambda: [samples])

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        spectra = acoustic_inference.spectra_of(blocks())
        if not len(spectra):
            return np.zeros((0, self.dim), np.float32)
        features = acoustic_inference.run_network(
            self._model.network, spectra, self._model.features
        )
        features *= voice_gate(voice.voice_activity_of_blocks(blocks))[:, None]
        return features


def voice_gate(activity: np.ndarray) -> np.ndarray:
    """1 up to 40 ms from any voice, 0 from 0.2 s on, smooth between; activity (T,) to (T,)."""
    near = maximum_filter1d((activity > _LEAST_VOICE).astype(np.float64), 2 * HOLD + 1)
    bell = np.hanning(2 * FADE + 3)[1:-1]
    return np.clip(convolve1d(near, bell / bell.sum(), mode="nearest"), 0, 1).astype(np.float32)
