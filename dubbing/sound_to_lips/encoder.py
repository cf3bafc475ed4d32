"""The first layers of a speech recogniser's encoder.

They are the first part of Moonshine tiny (Jeffries et al. 2024, "Moonshine: Speech Recognition for
Live Transcription and Voice Commands"): three convolutions over the samples, then transformer
layers. The last layers, nearer to words than to sounds, predict lips worse and are left out.

Letters: N samples at 16 kHz, T steps of 24 ms, C = 288 channels. Step t covers the samples
[384 t, 384 (t + 1)).
"""

from collections.abc import Iterable

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dubbing.speech.voice_activity import overlapping

STEP = 384  # samples
CHANNELS, HEADS, LAYERS = 288, 8, 4
ROTATED = 32  # channels of each head with a rotary position embedding
SLOWEST = 10_000.0  # steps over which the slowest of them turns by a radian
# Samples before the first and after the last step that the output depends on.
BEFORE, AFTER = 256, 255
# Steps encoded at once, and steps of context on each side: 30 s and 2 s.
PIECE, AROUND = 1250, 84


class Layer(nn.Module):
    """Self-attention with rotary position embedding, then a perceptron, each with a residual."""

    def __init__(self) -> None:
        super().__init__()
        self.before_attention = nn.LayerNorm(CHANNELS, bias=False)
        self.query, self.key, self.value, self.out = (
            nn.Linear(CHANNELS, CHANNELS, bias=False) for _ in range(4)
        )
        self.before_perceptron = nn.LayerNorm(CHANNELS, bias=False)
        self.wide = nn.Linear(CHANNELS, 4 * CHANNELS)
        self.narrow = nn.Linear(4 * CHANNELS, CHANNELS)

    def forward(self, x: Float[Tensor, "T C"], turn: tuple[Tensor, Tensor]) -> Float[Tensor, "T C"]:
        """Args: turn: cosine and sine of the angle of each rotated channel, (T, ROTATED)."""
        h = self.before_attention(x)
        query, key, value = (
            part(h).unflatten(1, (HEADS, -1)).transpose(0, 1)[None]
            for part in (self.query, self.key, self.value)
        )
        attended = F.scaled_dot_product_attention(rotated(query, turn), rotated(key, turn), value)
        x = x + self.out(attended[0].transpose(0, 1).flatten(1))
        moved: Tensor = self.narrow(F.gelu(self.wide(self.before_perceptron(x))))
        return x + moved


def rotated(x: Float[Tensor, "1 H T D"], turn: tuple[Tensor, Tensor]) -> Float[Tensor, "1 H T D"]:
    """The first channels, rotated in pairs by the angles of their step (Su et al. 2021)."""
    part, rest = x[..., :ROTATED], x[..., ROTATED:]
    across = torch.stack([-part[..., 1::2], part[..., ::2]], -1).flatten(-2)
    return torch.cat([part * turn[0] + across * turn[1], rest], -1)


class SpeechEncoder(nn.Module):
    """From samples to C numbers a step."""

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Conv1d(1, CHANNELS, 127, stride=64, bias=False)
        self.norm = nn.GroupNorm(1, CHANNELS)
        self.second = nn.Conv1d(CHANNELS, 2 * CHANNELS, 7, stride=3)
        self.third = nn.Conv1d(2 * CHANNELS, CHANNELS, 3, stride=2)
        self.layers = nn.ModuleList(Layer() for _ in range(LAYERS))

    def forward(self, samples: Float[Tensor, " N"]) -> Float[Tensor, "T C"]:
        """Steps of N = STEP T + BEFORE + AFTER samples."""
        h = self.norm(torch.tanh(self.first(samples[None, None])))
        h = F.gelu(self.third(F.gelu(self.second(h))))[0].mT
        rate = SLOWEST ** -(torch.arange(0, ROTATED, 2, device=h.device) / ROTATED)
        angle = (torch.arange(len(h), device=h.device)[:, None] * rate).repeat_interleave(2, 1)
        for layer in self.layers:
            h = layer(h, (angle.cos(), angle.sin()))
        return h


@torch.no_grad()
def encode(encoder: SpeechEncoder, blocks: Iterable[np.ndarray], gain: float) -> Tensor:
    """Encode audio that comes in blocks: (T, C), whatever the blocks.

    Args:
        blocks: samples at 16 kHz, one after the other.
        gain: factor of the samples.
    """
    pieces = overlapping(blocks, STEP, PIECE, AROUND, before=BEFORE, after=AFTER)
    encoded = [
        encoder(torch.from_numpy(samples * np.float32(gain)))[skipped:][:PIECE]
        for samples, skipped in pieces
    ]
    return torch.cat(encoded) if encoded else torch.zeros(0, CHANNELS)
