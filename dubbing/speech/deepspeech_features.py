"""Speech features of the published code: outputs of DeepSpeech 0.1.0, with a user's own weights.

Letters: N samples at 16 kHz, T steps of 20 ms, O = 29 outputs.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from dubbing.speech import voice_activity as voice
from dubbing.speech.deepspeech import cepstra as front
from dubbing.speech.deepspeech.deepspeech_network import OUTPUTS, load

# Steps processed at once, and steps of context on each side: a minute and 10 s.
PIECE, AROUND = 3000, 500


class DeepSpeechFeatures:
    """Outputs before the softmax, unchanged: silence is a symbol, too.

    The published code's windows of 16 steps start eight steps before the video frame, ours seven.
    So features are shifted by a step.
    """

    name = "deepspeech"
    dim = OUTPUTS

    def __init__(self, weights: Path) -> None:
        self._network = load(weights)

    def extract(self, samples: np.ndarray) -> np.ndarray:
        return self.extract_blocks(lambda: [samples])

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        samples = 0

        def counted() -> Iterator[np.ndarray]:
            nonlocal samples
            for block in blocks():
                samples += len(block)
                yield block

        # A window starts with its step; those of voice_activity are centred on theirs.
        margin = front.WIDTH - voice.HOP
        cepstra = [
            front.cepstra(windows[:, margin:])
            for windows in voice.step_windows(front.emphasised(counted()), voice.HOP + 2 * margin)
        ]
        if not cepstra:
            return np.zeros((0, OUTPUTS), np.float32)
        outputs = self._outputs(np.concatenate(cepstra)[: front.steps_heard(samples)])
        steps = voice.steps(samples)
        features = np.zeros((steps, OUTPUTS), np.float32)
        held = np.minimum(np.arange(steps - 1), len(outputs) - 1)
        features[1:] = outputs[held]
        return features

    @torch.no_grad()
    def _outputs(self, cepstra: np.ndarray) -> np.ndarray:
        """Outputs of all steps, (T, O); inputs are normalised by the level of the whole sound."""
        mean, deviation = front.level(cepstra)
        parts = []
        for begin in range(0, len(cepstra), PIECE):
            low, high = max(0, begin - AROUND), min(len(cepstra), begin + PIECE + AROUND)
            inputs = (front.inputs(cepstra, low, high) - mean) / deviation
            outputs = self._network(torch.from_numpy(inputs.astype(np.float32)))
            parts.append(outputs[begin - low :][:PIECE].numpy())
        return np.concatenate(parts)
