"""From a sound to what lips do, for people it never saw.

A frozen speech encoder, and a linear filter over its output: with some forty people on film to
learn from, a larger network on top learned them by heart.

Letters: T steps of 24 ms, C = 288 channels of the encoder, P = 40 outputs.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.speaker_adaptation import HEARD, PREDICTED
from dubbing.sound_to_lips.encoder import CHANNELS, SpeechEncoder

TAPS, STRIDE = 2, 2  # steps that the filter looks at, to each side of its own, and how far apart


class LipFilter(nn.Module):
    """What is predicted of the lips, and what is heard, as a person is adapted to them.

    Attributes:
        map: a linear filter over time, to lip measures of about mean 0 over speech, and touching
            lips.
        heard: the encoder's first principal components, of mean 0 and variance 1 over speech.
    """

    def __init__(self) -> None:
        super().__init__()
        self.map = nn.Linear(CHANNELS * (2 * TAPS + 1), PREDICTED)
        self.heard = nn.Linear(CHANNELS, HEARD)

    @staticmethod
    def around(x: Float[Tensor, "T C"]) -> Float[Tensor, "T K"]:
        """Each step with those around it, K = (2 TAPS + 1) C; the ends go on."""
        offsets = torch.arange(-TAPS, TAPS + 1, device=x.device) * STRIDE
        index = torch.arange(len(x), device=x.device)[:, None] + offsets
        return x[index.clamp(0, len(x) - 1)].flatten(1)

    def forward(self, x: Float[Tensor, "T C"]) -> Float[Tensor, "T P"]:
        """Lip measures, a score that rises where lips touch, and what is heard."""
        return torch.cat([self.map(self.around(x)), self.heard(x)], 1)


class LipNetwork(nn.Module):
    """The encoder and the filter."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SpeechEncoder()
        self.filter = LipFilter()
