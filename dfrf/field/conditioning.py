"""Conditioning of the field in each frame: the speech code and the upper face.

The code is computed from the sound, then moved so that it decodes to this person's lips. F frames
in a row, D speech features, A numbers of a code, L lip measures, U measures of the upper face,
C = L + 1: lip measures, and how far such lips are closed.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.config import FieldConfig
from dfrf.field.audio import LEAK, AudioAttNet, AudioNet
from dfrf.field.speaker_adaptation import LIP_MEASURES, SpeakerAdaptation, with_closures


def silence(windows: Float[Tensor, "F W D"]) -> Float[Tensor, "F 1"]:
    """Share of the middle half of each window that is silent: all features are 0."""
    quarter = windows.shape[1] // 4
    silent = (windows[:, quarter:-quarter] == 0).all(-1)
    return silent.to(windows.dtype).mean(1, keepdim=True)


class Conditioning(nn.Module):
    """From speech windows and the upper face to K = A + U numbers a frame.

    Attributes:
        closed_mouth_target: lip measures decoded from the code where the person's mouth is closed.
        lips: decodes lip measures from the code; a person's own have mean 0 and variance 1.
        speaker_adaptation: from predicted lips to this person's; at first, the identity.
    """

    closed_mouth_target: Float[Tensor, " L"]

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        self.config = config
        if not config.use_speech:
            return
        self.audio = AudioNet(config.speech_dim, config.code_dim)
        self.attention = AudioAttNet()
        self.lips = nn.Linear(config.code_dim, LIP_MEASURES)
        self.register_buffer("closed_mouth_target", torch.zeros(LIP_MEASURES))
        self.speaker_adaptation = SpeakerAdaptation()
        for layer in self.audio.modules():
            if isinstance(layer, nn.Conv1d | nn.Linear) and layer.bias is not None:
                # The default start gives the same code for every sound.
                nn.init.kaiming_normal_(layer.weight, a=LEAK)
                nn.init.zeros_(layer.bias)

    def speech_codes(self, windows: Float[Tensor, "F 8 W D"]) -> Float[Tensor, "F A"]:
        """The code A of each frame from the windows of its neighbours."""
        if not self.config.use_speech:
            return windows.new_zeros(windows.shape[0], self.config.code_dim)
        frames, neighbours = windows.shape[:2]
        # Features are 0 in silence and about 1 in speech: centred, a network learns from both.
        codes = self.audio(windows.flatten(0, 1) * 2 - 1).view(frames, neighbours, -1)
        return self.attention(codes)

    def with_codes(
        self, conditioning: Float[Tensor, "F K"], windows: Float[Tensor, "F 8 W D"]
    ) -> Float[Tensor, "F K"]:
        """Conditioning whose codes are computed from the sound anew."""
        codes = self.speech_codes(windows)
        return torch.cat([codes, conditioning[:, codes.shape[1] :]], 1)

    def project_to_lips(
        self, codes: Float[Tensor, "F A"], lips: Float[Tensor, "*B L"]
    ) -> Float[Tensor, "F A"]:
        """The nearest codes that decode to the given lip measures."""
        return codes + (lips - self.lips(codes)) @ torch.linalg.pinv(self.lips.weight).T

    def wanted_lips(
        self,
        windows: Float[Tensor, "F 8 W D"],
        predicted_lips: Float[Tensor, "N P"],
        given: Float[Tensor, "F C"] | None = None,
    ) -> Float[Tensor, "F C"]:
        """The person's lips in F frames but for closures, and how far they are closed, 0..1.

        N = F + 2 CONTEXT_FRAMES. In silence the mouth is closed. Numbers that are `given` take
        their place; without a closure of their own, given lips are not closed further.
        """
        closed = self.closed_mouth_target
        lips, share = self.speaker_adaptation(predicted_lips)
        silent = silence(windows[:, windows.shape[1] // 2]).to(lips)
        if given is not None:
            given = given.to(lips)
            silent = silent * given.isnan().all(1, keepdim=True)
        lips = torch.lerp(lips, closed, silent)
        if given is None:
            return torch.cat([lips, share[:, None]], 1)
        as_given = given[:, -1].isnan() & ~given.isnan().all(1)
        done = with_closures(lips, share * as_given, closed)
        heard = torch.cat([done, (share * ~as_given)[:, None]], 1)
        return torch.where(given.isnan(), heard, given)

    def adapted_codes(
        self,
        windows: Float[Tensor, "F 8 W D"],
        predicted_lips: Float[Tensor, "N P"],
        strength: Float[Tensor, " F"] | None = None,
        given: Float[Tensor, "F C"] | None = None,
    ) -> Float[Tensor, "F A"]:
        """Codes of F frames as this person speaks; N = F + 2 CONTEXT_FRAMES.

        They decode to `wanted_lips`, closed and then moved away from the closed mouth by
        `strength`. With 0 frames have the code of silence: a code also holds what no lip measure is
        read from.
        """
        codes, closed = self.speech_codes(windows), self.closed_mouth_target
        wanted = self.wanted_lips(windows, predicted_lips, given)
        lips = with_closures(wanted[:, :-1], wanted[:, -1], closed)
        if strength is not None:
            silent_code = self.speech_codes(torch.zeros_like(windows[:1]))
            share = strength[:, None].to(codes)
            codes = torch.lerp(silent_code, codes, share.clamp(max=1))
            lips = torch.lerp(closed, lips, share.to(lips))
        return self.project_to_lips(codes, lips)

    def forward(
        self,
        windows: Float[Tensor, "F 8 W D"],
        predicted_lips: Float[Tensor, "N P"],
        expression: Float[Tensor, "F U"],
        strength: Float[Tensor, " F"] | None = None,
        given: Float[Tensor, "F C"] | None = None,
    ) -> Float[Tensor, "F K"]:
        """Conditioning of F frames in a row when their person speaks; N = F + 2 CONTEXT_FRAMES.

        In silence, features are 0 and the mouth is closed.

        Args:
            windows: speech windows of each frame's neighbours.
            predicted_lips: of these frames and of those beside them, see `speaker_adaptation`.
            expression: measures of the upper face.
            strength: of the lips' movement, 1 as spoken, as is None; see `adapted_codes`.
            given: lip measures and closures in the place of the person's, NaN where these stay.

        Raises:
            ValueError: one of these, of networks that do not learn from lip measures.
        """
        if self.config.learns_lips:
            codes = self.adapted_codes(windows, predicted_lips, strength, given)
        elif given is not None or (strength is not None and (strength != 1).any()):
            raise ValueError("a strength or lips of a model without lip measures")
        else:
            codes = self.speech_codes(windows)
        return torch.cat([codes, expression], -1)
