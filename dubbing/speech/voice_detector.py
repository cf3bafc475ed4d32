"""The voice detector, Silero VAD (MIT), with the published weights.

It separates speech from music and noise.

Letters: C chunks of 32 ms, F = 129 frequencies, H = 128 hidden values.
"""

from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from safetensors.torch import load_file
from torch import Tensor, nn

from dubbing.speech.weight_paths import VOICE_DETECTOR

CHUNK = 512  # samples at 16 kHz
CONTEXT = 64  # samples before a chunk that are passed with it
FREQUENCIES = 129
# Of the layers: channels and stride.
CHANNELS, STRIDES = (FREQUENCIES, 128, 64, 64, 128), (1, 2, 2, 1)


class VoiceDetector(nn.Module):
    """Spectrum, four convolutions and a recurrent layer from chunk to chunk."""

    def __init__(self) -> None:
        super().__init__()
        self.spectrum = nn.Conv1d(1, 2 * FREQUENCIES, 256, stride=128, bias=False)
        self.layers = nn.ModuleList(
            nn.Conv1d(a, b, 3, stride, padding=1)
            for (a, b), stride in zip(pairwise(CHANNELS), STRIDES, strict=True)
        )
        self.recurrent = nn.LSTM(CHANNELS[-1], CHANNELS[-1])
        self.last = nn.Conv1d(CHANNELS[-1], 1, 1)

    def forward(
        self, chunks: Float[Tensor, "C 576"], state: tuple[Tensor, Tensor] | None
    ) -> tuple[Float[Tensor, " C"], tuple[Tensor, Tensor]]:
        """Probability of speech in consecutive chunks, and the state after them."""
        x = self.spectrum(F.pad(chunks[:, None], (0, CONTEXT), mode="reflect"))
        x = torch.hypot(x[:, :FREQUENCIES], x[:, FREQUENCIES:])
        for layer in self.layers:
            x = layer(x).relu()
        hidden, state = self.recurrent(x[:, :, 0], state)
        return self.last(hidden.relu()[:, :, None])[:, 0, 0].sigmoid(), state


@lru_cache(maxsize=1)
def load() -> VoiceDetector:
    """The detector with its weights."""
    weights = load_file(VOICE_DETECTOR)
    names = {"stft_conv": "spectrum", "final_conv": "last"}
    names |= {f"conv{k + 1}": f"layers.{k}" for k in range(len(STRIDES))}
    renamed = {}
    for name, value in weights.items():
        layer, kind = name.split(".")
        renamed[f"{names[layer]}.{kind}" if layer in names else f"recurrent.{kind}_l0"] = value
    detector = VoiceDetector()
    detector.load_state_dict(renamed)
    return detector.eval()


@torch.no_grad()
def probabilities(pieces: Iterable[np.ndarray]) -> np.ndarray:
    """Probability of speech in every chunk of a sound, (C,).

    Args:
        pieces: of the sound at 16 kHz, in order; each but the last of whole chunks.
    """
    detector, state = load(), None
    before, parts = np.zeros(CONTEXT, np.float32), [np.zeros(0, np.float32)]
    for piece in pieces:
        sound = np.concatenate([before, piece, np.zeros(-len(piece) % CHUNK, np.float32)])
        chunks = torch.from_numpy(sound).unfold(0, CONTEXT + CHUNK, CHUNK)
        chances, state = detector(chunks, state)
        parts.append(chances.numpy())
        before = sound[-CONTEXT:]
    return np.concatenate(parts)
