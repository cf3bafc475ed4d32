"""The network that predicts lips from sound, for people it was not trained on.

A frozen speech encoder, and a linear filter over its output: trained on some forty people, a larger
network on top overfitted.

Letters: T steps of 24 ms, C = 288 channels of the encoder, P = 40 outputs.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.speaker_adaptation import HEARD, PREDICTED
from dubbing.sound_to_lips.encoder import CHANNELS, SpeechEncoder

TAPS, STRIDE = 2, 2  # taps of the filter to each side, and steps between them


class LipFilter(nn.Module):
    """Predicted lips and sound features, the inputs of speaker adaptation.

    Attributes:
        map: a linear filter over time, to lip measures of about mean 0 over speech, and a score of
            touching lips.
        heard: the encoder's first principal components, of mean 0 and variance 1 over speech.
    """

    def __init__(self) -> None:
        super().__init__()
        self.map = nn.Linear(CHANNELS * (2 * TAPS + 1), PREDICTED)
        self.heard = nn.Linear(CHANNELS, HEARD)

    @staticmethod
    def around(x: Float[Tensor, "T C"]) -> Float[Tensor, "T K"]:
        """Each step with its neighbours, K = (2 TAPS + 1) C; the ends are replicated."""
        offsets = torch.arange(-TAPS, TAPS + 1, device=x.device) * STRIDE
        index = torch.arange(len(x), device=x.device)[:, None] + offsets
        return x[index.clamp(0, len(x) - 1)].flatten(1)

    def forward(self, x: Float[Tensor, "T C"]) -> Float[Tensor, "T P"]:
        """Lip measures, a score that rises where lips touch, and sound features."""
        return torch.cat([self.map(self.around(x)), self.heard(x)], 1)


class LipNetwork(nn.Module):
    """The encoder and the filter."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SpeechEncoder()
        self.filter = LipFilter()
