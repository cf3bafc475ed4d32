"""A finished head, as crisp as the film that it is laid into.

S is the picture's side in pixels.
"""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor

from dfrf.published.references import sharpened

SOFTNESS = 0.2  # px^2 along an axis by which a head is softer than film


def crisp(colour: Tensor, opacity: Tensor) -> Tensor:
    """Premultiplied colour (S, S, 3), sharpened where the head is opaque.

    References are sharp enough for being read between pixels (`references.sharpened`); this is for
    several being mixed, each a little misplaced. Compositors do the same to a soft element.

    Args:
        opacity: (S, S); at the head's edge, where it falls, nothing changes.
    """
    inside = -F.max_pool2d(-opacity[None], 3, stride=1, padding=1)[0, :, :, None]
    return colour + inside * (sharpened(colour[None], SOFTNESS)[0] - colour)
