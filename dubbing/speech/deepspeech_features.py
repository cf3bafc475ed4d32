"""What models of the published code hear: outputs of DeepSpeech 0.1.0, weights of a user's own.

Letters: N samples at 16 kHz, T steps of 20 ms, O = 29 outputs.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import torch

from dubbing.speech import voice_activity as voice
from dubbing.speech.deepspeech import cepstra as front
from dubbing.speech.deepspeech.deepspeech_network import OUTPUTS, load

# Steps worked on at once, and how many more are heard on each side: a minute and 10 s.
PIECE, AROUND = 3000, 500


class DeepSpeechFeatures:
    """Outputs before the softmax, as they are: silence is a symbol, too.

    The published code's windows of 16 steps begin eight steps before the video frame does, ours
    seven. So features come a step late.
    """

    name = "deepspeech"
    dim = OUTPUTS
    rate = voice.STEP_RATE

    def __init__(self, weights: Path) -> None:
        self._network = load(weights)

    def extract(self, samples: np.ndarray) -> np.ndarray:
        return self.extract_blocks(lambda: [samples])

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        counted = _Counted(blocks())
        # A window begins with its step; those that voice_activity gives are centred on theirs.
        margin = front.WIDTH - voice.HOP
        found = [
            front.cepstra(windows[:, margin:])
            for windows in voice.step_windows(front.emphasised(counted), voice.HOP + 2 * margin)
        ]
        if not found:
            return np.zeros((0, OUTPUTS), np.float32)
        outputs = self._outputs(np.concatenate(found)[: front.steps_heard(counted.samples)])
        steps = voice.steps(counted.samples)
        features = np.zeros((steps, OUTPUTS), np.float32)
        held = np.minimum(np.arange(steps - 1), len(outputs) - 1)
        features[1:] = outputs[held]
        return features

    @torch.no_grad()
    def _outputs(self, found: np.ndarray) -> np.ndarray:
        """Outputs of all steps, (T, O); the level taken out is that of the whole sound."""
        mean, deviation = front.level(found)
        parts = []
        for begin in range(0, len(found), PIECE):
            low, high = max(0, begin - AROUND), min(len(found), begin + PIECE + AROUND)
            inputs = (front.inputs(found, low, high) - mean) / deviation
            made = self._network(torch.from_numpy(inputs.astype(np.float32)))
            parts.append(made[begin - low :][:PIECE].numpy())
        return np.concatenate(parts)


class _Counted:
    """Blocks of a sound, and how many samples they were."""

    def __init__(self, blocks: Iterable[np.ndarray]) -> None:
        self._blocks = blocks
        self.samples = 0

    def __iter__(self) -> Iterator[np.ndarray]:
        for block in self._blocks:
            self.samples += len(block)
            yield block
