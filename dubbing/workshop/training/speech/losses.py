"""Losses of the acoustic network: of its teacher's senones, the phones, and the lips.

Letters as in `dubbing.speech.acoustic_network`.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from dubbing.speech.acoustic_network import AcousticOutput


def losses(
    output: AcousticOutput,
    senones: Float[Tensor, "B T S"],
    phones: Float[Tensor, "B T"],
    lips: Float[Tensor, "B T M"],
    known: Float[Tensor, "B T"],
) -> tuple[Tensor, Tensor, Tensor]:
    """Cross-entropy to the teacher's senones and to the phones, squared error of the lips.

    Args:
        known: 1 where the step belongs to a sound, 0 where it is padding; phones of -1 and lips
            of NaN are ignored.
    """
    total = known.sum().clamp_min(1)
    teacher = -(senones * F.log_softmax(output.senones, -1)).sum(-1)
    labelled = (phones >= 0) & (known > 0)
    named = F.cross_entropy(output.phones[labelled], phones[labelled], label_smoothing=0.05)
    shaped = torch.isfinite(lips).all(-1) & (known > 0)
    squared = (output.lips[shaped] - lips[shaped]).square().sum(-1)
    zero = output.hidden.sum() * 0
    return (
        (teacher * known).sum() / total,
        named if labelled.any() else zero,
        squared.mean() if shaped.any() else zero,
    )
