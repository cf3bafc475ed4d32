"""A user's own HuBERT or wav2vec 2.0 as speech features, from a folder on this machine.

The folder is written by `save_pretrained` of the transformers package: config.json and the weights.
Nothing is downloaded.

Letters: N samples at 16 kHz, T steps of 20 ms, D values of the last hidden layer.
"""

import importlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from dubbing import packages
from dubbing.errors import ExplainedError
from dubbing.speech import voice_activity as voice
from dubbing.speech.rnn_features import voice_gate
from dubbing.speech.weight_paths import weights_file

MODELS = {"hubert": "HubertModel", "wav2vec2": "Wav2Vec2Model"}
# Both kinds give a value for 400 samples every 320.
RECEPTIVE_FIELD = 400
# Steps processed at once, and steps of context on each side: 20 s and 2 s.
PIECE, AROUND = 1000, 100


class TransformerFeatures:
    """Last hidden layer minus its value in silence; 0 where nobody speaks."""

    def __init__(self, name: str, folder: Path) -> None:
        """Reads the model.

        Raises:
            ExplainedError: the folder holds no such model, or transformers is not installed.
        """
        weights_file(folder, name)
        self.name = name
        self._model = _load(name, folder)
        self.dim = int(self._model.config.hidden_size)
        quiet = self._hidden(np.zeros(voice.SAMPLE_RATE, np.float32))
        self._silence = quiet.mean(0)

    def extract(self, samples: np.ndarray) -> np.ndarray:
        return self.extract_blocks(lambda: [samples])

    def extract_blocks(self, blocks: voice.Blocks) -> np.ndarray:
        mean, deviation, count = _level(blocks())
        if not count:
            return np.zeros((0, self.dim), np.float32)
        parts = [
            self._hidden((samples - mean) / deviation)[skipped:][:PIECE] - self._silence
            for samples, skipped in voice.overlapping(blocks(), voice.HOP, PIECE, AROUND)
        ]
        features = np.concatenate(parts)
        features *= voice_gate(voice.voice_activity_of_blocks(blocks))[:, None]
        return features

    @torch.no_grad()
    def _hidden(self, samples: np.ndarray) -> np.ndarray:
        """Hidden layer of every whole step of `samples`, (T, D)."""
        margin = (RECEPTIVE_FIELD - voice.HOP) // 2
        padded = np.pad(samples.astype(np.float32), (margin, margin))
        hidden = self._model(torch.from_numpy(padded)[None]).last_hidden_state
        return hidden[0].float().numpy()


def _load(name: str, folder: Path) -> Any:
    try:
        transformers = importlib.import_module("transformers")
    except ImportError as error:
        raise ExplainedError(
            f"{name} features need the transformers package: {error}",
            remedy=f"run {packages.command(['transformers'])}, or choose speech: rnn",
        ) from error
    kind = getattr(transformers, MODELS[name])
    try:
        return kind.from_pretrained(str(folder), local_files_only=True).eval()
    except (OSError, ValueError, RuntimeError) as error:
        raise ExplainedError(f"the model cannot be read: {error}", str(folder)) from error


def _level(blocks: Iterable[np.ndarray]) -> tuple[float, float, int]:
    """Mean, deviation and number of all samples; these networks expect normalised ones."""
    total = squares = 0.0
    count = 0
    for block in blocks:
        wide = np.asarray(block, np.float64)
        total += float(wide.sum())
        squares += float((wide**2).sum())
        count += len(wide)
    mean = total / max(count, 1)
    return mean, max(squares / max(count, 1) - mean**2, 1e-10) ** 0.5, count
