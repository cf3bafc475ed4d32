"""Speech codes A: AudioNet on one window, then temporal self-attention over neighbouring frames.

A window is 16 steps of 20 ms round the middle of a video frame, D features a step.
"""

from __future__ import annotations

from itertools import pairwise

import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

WINDOW = 16
NEIGHBOURS = 8
LEAK = 0.02


def attend(codes: Float[Tensor, "*B K C"], logits: Float[Tensor, "*B K"]) -> Float[Tensor, "*B C"]:
    """Sum of the codes, weighted by the softmax of the logits."""
    return (logits.softmax(-1)[..., None] * codes).sum(-2)


class AudioNet(nn.Module):
    """Four strided convolutions over time (length 16, 8, 4, 2, 1) and two linear layers.

    Args:
        speech_dim: D, features a step (29 DeepSpeech logits in the published model).
        code_dim: width of the code.
        widths: channels of the first three convolutions; the fourth has `code_dim`.
    """

    def __init__(
        self, speech_dim: int = 29, code_dim: int = 64, widths: tuple[int, ...] = (32, 32, 64)
    ) -> None:
        super().__init__()
        channels = (speech_dim, *widths, code_dim)
        self.convolutions = nn.ModuleList(
            nn.Conv1d(a, b, kernel_size=3, stride=2, padding=1) for a, b in pairwise(channels)
        )
        self.hidden = nn.Linear(code_dim, code_dim)
        self.out = nn.Linear(code_dim, code_dim)

    def forward(self, windows: Float[Tensor, "*B W D"]) -> Float[Tensor, "*B C"]:
        """Codes of single windows; W is 16, or 2 to the power of the convolutions."""
        x = windows.reshape(-1, *windows.shape[-2:]).transpose(1, 2)
        for convolution in self.convolutions:
            x = F.leaky_relu(convolution(x), LEAK)
        code = self.out(F.leaky_relu(self.hidden(x.squeeze(-1)), LEAK))
        return code.reshape(*windows.shape[:-2], -1)


class AudioAttNet(nn.Module):
    """Temporal self-attention over the codes of neighbouring frames (section 3.2 of the paper).

    The published model computes the attention from the first 32 of the 64 numbers of a code.

    Args:
        attended: numbers of a code that the attention is computed from.
        neighbours: K, codes in a set.
        widths: channels between the first and the last convolution.
    """

    def __init__(
        self,
        attended: int = 32,
        neighbours: int = NEIGHBOURS,
        widths: tuple[int, ...] = (16, 8, 4, 2),
    ) -> None:
        super().__init__()
        self.attended = attended
        channels = (attended, *widths, 1)
        self.convolutions = nn.ModuleList(
            nn.Conv1d(a, b, kernel_size=3, padding=1) for a, b in pairwise(channels)
        )
        self.out = nn.Linear(neighbours, neighbours)

    def logits(self, codes: Float[Tensor, "*B K C"]) -> Float[Tensor, "*B K"]:
        """How much each neighbour counts, before the softmax."""
        x = codes[..., : self.attended].reshape(-1, codes.shape[-2], self.attended).transpose(1, 2)
        for convolution in self.convolutions:
            x = F.leaky_relu(convolution(x), LEAK)
        return self.out(x.squeeze(1)).reshape(codes.shape[:-1])

    def forward(self, codes: Float[Tensor, "*B K C"]) -> Float[Tensor, "*B C"]:
        """The smoothed code of the frame in the middle of K neighbours."""
        return attend(codes, self.logits(codes))
