"""The recurrent acoustic network: log-mel spectra to senones, phones and lips, 50 times a second.

Letters: B sounds, T steps of 20 ms, C = 128 inputs a step, H = 2 x WIDTH, S = 126 senones,
P phone classes, M = 7 lip channels.
"""

from typing import NamedTuple

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from dubbing.speech.acoustic_input import BANDS, SPECTRA

# The teacher's context-independent states, the classes of `workshop.training.speech.phones`, and
# the channels of `workshop.synthetic.visemes`.
SENONES, PHONES, LIPS = 126, 41, 7
CHANNELS, WIDTH, DROPOUT = 192, 144, 0.1


class AcousticOutput(NamedTuple):
    """Hidden state (B, T, H); logits of senones (B, T, S) and phones (B, T, P); lips (B, T, M)."""

    hidden: Tensor
    senones: Tensor
    phones: Tensor
    lips: Tensor


class AcousticNetwork(nn.Module):
    """Two convolutions and a bidirectional GRU of two layers."""

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Conv1d(SPECTRA * BANDS, CHANNELS, 5, padding=2)
        self.second = nn.Conv1d(CHANNELS, CHANNELS, 3, padding=1)
        self.norm = nn.LayerNorm(CHANNELS)
        self.gru = nn.GRU(CHANNELS, WIDTH, 2, batch_first=True, bidirectional=True, dropout=DROPOUT)
        self.dropout = nn.Dropout(DROPOUT)
        self.senones = nn.Linear(2 * WIDTH, SENONES)
        self.phones = nn.Linear(2 * WIDTH, PHONES)
        self.lips = nn.Linear(2 * WIDTH, LIPS)

    def forward(self, spectra: Float[Tensor, "B T C"]) -> AcousticOutput:
        x = F.gelu(self.first(spectra.transpose(1, 2)))
        x = F.gelu(self.second(self.dropout(x))).transpose(1, 2)
        hidden, _ = self.gru(self.dropout(self.norm(x)))
        dropped = self.dropout(hidden)
        return AcousticOutput(
            hidden, self.senones(dropped), self.phones(dropped), self.lips(dropped)
        )
