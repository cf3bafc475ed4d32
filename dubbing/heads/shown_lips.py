"""Where heads that speak show their lips."""

from __future__ import annotations

import numpy as np
import torch

from dfrf.cameras import project
from dfrf.fast.fast_model import FastModel
from dfrf.field.mouth_pixels import wanted_lips
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.method_interface import FrameInputs, Maps
from dfrf.model_interface import HeadModel


@torch.no_grad()
def shown_lips(person: HeadModel, maps: Maps | None, inputs: FrameInputs) -> np.ndarray | None:
    """Lips of F frames, (F, Q, 2) px; None of a model that reads no crops of mouths."""
    if not isinstance(person, FastModel) or not isinstance(maps, ReferenceMaps):
        return None
    if (mouths := maps.views.mouths) is None:
        return None
    own = person.field.conditioning
    codes = own.adapted_codes(inputs.windows, inputs.predicted_lips, inputs.strength, inputs.lips)
    down = mouths.shape.new_tensor([1, -1])
    seen = []
    for t, measures in enumerate(own.lips(codes)):
        wanted = wanted_lips(mouths, measures, inputs.c2w[t, :, 3])
        at = torch.cat([mouths.shape[:, :2] + wanted * down, mouths.shape[:, 2:]], 1)
        seen.append(project(at, inputs.c2w[t : t + 1], inputs.focal, inputs.centres[t : t + 1])[0])
    return np.asarray(torch.stack(seen).cpu())
