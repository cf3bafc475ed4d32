"""From a sound to what lips do, for people it never saw.

A frozen speech encoder, and a linear filter over its output: with some forty people on film to
learn from, a larger network on top learned them by heart.

Letters: T steps of 24 ms, C = 288 channels of the encoder, O = 8 outputs.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dubbing.sound_to_lips.encoder import CHANNELS, SpeechEncoder

MEASURES = 7  # as `dubbing.face.lip_measures.LIP_DISTANCES`
CLOSED = MEASURES  # the output for lips that touch
OUTPUTS = MEASURES + 1
TAPS, STRIDE = 2, 2  # steps that the filter looks at, to each side of its own, and how far apart


class LipFilter(nn.Module):
    """A linear filter over time: lip measures of about mean 0 over speech, and touching lips."""

    def __init__(self) -> None:
        super().__init__()
        self.map = nn.Linear(CHANNELS * (2 * TAPS + 1), OUTPUTS)

    @staticmethod
    def around(x: Float[Tensor, "T C"]) -> Float[Tensor, "T K"]:
        """Each step with those around it, K = (2 TAPS + 1) C; the ends go on."""
        offsets = torch.arange(-TAPS, TAPS + 1, device=x.device) * STRIDE
        index = torch.arange(len(x), device=x.device)[:, None] + offsets
        return x[index.clamp(0, len(x) - 1)].flatten(1)

    def forward(self, x: Float[Tensor, "T C"]) -> Float[Tensor, "T O"]:
        """Lip measures and a score that rises where lips touch."""
        answer: Tensor = self.map(self.around(x))
        return answer


class LipNetwork(nn.Module):
    """The encoder and the filter."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SpeechEncoder()
        self.filter = LipFilter()
