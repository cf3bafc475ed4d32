"""From what the acoustic network hears to what lips do, for people it never saw.

Two closed-form linear filters and a few small convolutional networks, whose answers are added up:
each is wrong in its own way, and people on film are too few for a larger network.

Letters: B sounds, T steps of 20 ms, S = 414 outputs of the acoustic network, D = 64 speech
features, O = 16 outputs: the lip measures, lips that touch, and how the outline moves.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

MEASURES = 7  # as `dubbing.face.lip_measures.LIP_DISTANCES`
CLOSED = MEASURES  # which output says that the lips touch
OUTLINE = 8  # principal directions of the lips' outline: learned beside, not used
OUTPUTS = MEASURES + 1 + OUTLINE
HIDDEN, SENONES = 288, 126  # of the acoustic network's outputs


@dataclass(frozen=True)
class Sizes:
    """Sizes of a `LipNetwork`.

    Attributes:
        hidden_taps, senone_taps: steps that a linear filter looks at, before and after its own.
        hidden_stride, senone_stride: steps between two of them.
        members: convolutional networks.
        width: channels of each.
        dilations: of their layers, 5 taps each.
    """

    hidden_taps: int = 3
    hidden_stride: int = 4
    senone_taps: int = 6
    senone_stride: int = 2
    members: int = 4
    width: int = 96
    dilations: tuple[int, ...] = (1, 2, 4)
    dropout: float = 0.4


class Linear(nn.Module):
    """A linear filter over time: (B, T, C) to (B, T, O) from taps to both sides of each step."""

    def __init__(self, channels: int, taps: int, stride: int) -> None:
        super().__init__()
        self.taps, self.stride = taps, stride
        self.map = nn.Linear(channels * (2 * taps + 1), MEASURES + 1)

    def around(self, x: Float[Tensor, "B T C"]) -> Tensor:
        """Each step with those around it, (B, T, (2 taps + 1) C); the ends go on."""
        count = x.shape[1]
        offsets = torch.arange(-self.taps, self.taps + 1, device=x.device) * self.stride
        index = (torch.arange(count, device=x.device)[:, None] + offsets).clamp(0, count - 1)
        return x[:, index].flatten(2)

    def forward(self, x: Float[Tensor, "B T C"]) -> Tensor:
        answer: Tensor = self.map(self.around(x))
        return answer


class Member(nn.Module):
    """Dilated convolutions with what came before added to each, 25 times a second inside."""

    def __init__(self, channels: int, sizes: Sizes) -> None:
        super().__init__()
        width = sizes.width
        self.spoil = nn.Dropout1d(sizes.dropout)
        self.first = nn.Conv1d(channels, width, 2, stride=2)
        self.norms = nn.ModuleList(nn.GroupNorm(1, width) for _ in sizes.dilations)
        self.wide = nn.ModuleList(
            nn.Conv1d(width, width, 5, padding=2 * d, dilation=d) for d in sizes.dilations
        )
        self.mixed = nn.ModuleList(nn.Conv1d(width, width, 1) for _ in sizes.dilations)
        self.dropout = nn.Dropout(sizes.dropout)
        self.last = nn.Linear(width, 2 * OUTPUTS)

    def forward(self, x: Float[Tensor, "B T D"]) -> Float[Tensor, "B T O"]:
        count = x.shape[1]
        h = self.first(self.spoil(F.pad(x.mT, (0, count % 2))))
        for norm, wide, mixed in zip(self.norms, self.wide, self.mixed, strict=True):
            h = h + mixed(self.dropout(F.gelu(wide(norm(h)))))
        answer: Tensor = self.last(self.dropout(h.mT))
        return answer.unflatten(-1, (2, OUTPUTS)).flatten(1, 2)[:, :count]


class LipNetwork(nn.Module):
    """All of them together.

    Attributes:
        scale: (parts, 8) what each part's answers are multiplied by, so that none outshouts the
            others; parts are the two filters and the members.
    """

    scale: Tensor
    projection: Tensor
    silence: Tensor

    def __init__(self, projection: Tensor, silence: Tensor, sizes: Sizes | None = None) -> None:
        """
        Args:
            projection, silence: (D, S) and (D,) of the speech features `rnn`.
        """
        super().__init__()
        self.sizes = sizes or Sizes()
        s = self.sizes
        self.register_buffer("projection", projection)
        self.register_buffer("silence", silence)
        self.hidden = Linear(HIDDEN, s.hidden_taps, s.hidden_stride)
        self.senones = Linear(SENONES + 1, s.senone_taps, s.senone_stride)
        self.members = nn.ModuleList(Member(len(projection), s) for _ in range(s.members))
        self.register_buffer("scale", torch.ones(2 + s.members, MEASURES + 1))

    def inputs(
        self, activations: Float[Tensor, "B T S"], voice: Float[Tensor, "B T"]
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Of the filter of hidden values, of that of senones, and of the members."""
        if activations.shape[-1] != HIDDEN + SENONES:
            raise ValueError(
                f"{HIDDEN + SENONES} values a step are expected, not {activations.shape[-1]}"
            )
        gate = voice[..., None]
        features = (activations @ self.projection.T - self.silence) * gate
        senones = torch.cat([activations[..., HIDDEN:] * gate, gate], -1)
        return activations[..., :HIDDEN] * gate, senones, features

    def parts(
        self, activations: Float[Tensor, "B T S"], voice: Float[Tensor, "B T"]
    ) -> list[Float[Tensor, "B T 8"]]:
        """What each says of the lip measures and of touching lips."""
        hidden, senones, features = self.inputs(activations, voice)
        answers = [self.hidden(hidden), self.senones(senones)]
        return answers + [m(features)[..., : MEASURES + 1] for m in self.members]

    def forward(
        self, activations: Float[Tensor, "B T S"], voice: Float[Tensor, "B T"]
    ) -> Float[Tensor, "B T 8"]:
        """Lip measures, of about mean 0 over speech, and a score that rises where lips touch.

        Args:
            activations: `dubbing.speech.acoustic_weights.outputs`.
            voice: `dubbing.speech.rnn_features.voice_gate`.
        """
        found = self.parts(activations, voice)
        both = found[0] * self.scale[0] + found[1] * self.scale[1]
        rest = torch.stack([f * s for f, s in zip(found[2:], self.scale[2:], strict=True)]).mean(0)
        # The members count as much as the filters do together.
        return both / 4 + rest / 2

    def settings(self) -> dict[str, object]:
        """What is kept beside the weights."""
        return asdict(self.sizes)
