"""Refining a head's pose until its rendering lies on the picture (analysis by synthesis).

Poses of `prepare` come from the skin of the face and the outline of the head, by way of a mean
face. A learned head knows its own hair, ears and depth: where it is rendered beside the picture,
the pose is wrong. One Gauss-Newton step at a time, as in iNeRF (Yen-Chen et al. 2021), but with
differences in place of gradients: six more renderings of a thousand rays.

B rays. A correction is (6,): a rotation vector in radians about the head's origin and a shift in
head units, both in the head frame, by which the camera moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.cameras import pixel_rays
from dfrf.field.model import Model
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.volume_rendering import render_rays

# A third of a pixel or so at the rim of a head of 300 px: beyond rounding, within the detail.
STEPS = (0.004, 0.004, 0.004, 0.004, 0.004, 0.006)
OUTLIER = 0.2  # colour distance at which a residual counts for a quarter


@dataclass(frozen=True)
class Sight:
    """Pixels of one frame that its pose is held to.

    Attributes:
        pixels: (B, 2) column, row.
        colour, background: (B, 3) in 0..1.
        focal: pixels; centre (2,).
    """

    pixels: Tensor
    colour: Tensor
    background: Tensor
    focal: float
    centre: Tensor

    def to(self, device: torch.device) -> Sight:
        """The same on a device."""
        return Sight(
            self.pixels.to(device),
            self.colour.to(device),
            self.background.to(device),
            self.focal,
            self.centre.to(device),
        )


def moved(c2w: Tensor, correction: Tensor) -> Tensor:
    """Cameras (..., 3, 4) moved by corrections (..., 6)."""
    x, y, z = correction[..., :3].unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).unflatten(-1, (3, 3))
    turned = torch.linalg.matrix_exp(cross) @ c2w
    shift = F.pad(correction[..., 3:, None], (3, 0))
    return turned + shift


@torch.no_grad()
def normal_equations(
    model: Model,
    sight: Sight,
    c2w: Tensor,
    told: Tensor,
    maps: ReferenceMaps | None,
) -> tuple[Tensor, Tensor]:
    """J^T W J (6, 6) and -J^T W r (6,) of one frame at its pose.

    r is the rendering over the background less the picture, W the weights of Geman and McClure's
    loss, so that what moves by itself (lids, strands of hair) has little say.

    Args:
        c2w: (3, 4).
        told: (told_dim,) what the field is told of the frame.
    """
    if not len(sight.pixels):
        return c2w.new_zeros(6, 6), c2w.new_zeros(6)
    steps = torch.diag(c2w.new_tensor(STEPS))
    cameras = moved(c2w, torch.cat([torch.zeros_like(steps[:1]), steps]))
    count = len(sight.pixels)
    origins, directions = pixel_rays(cameras[:, None], sight.focal, sight.centre, sight.pixels)
    seen = render_rays(
        model,
        origins.reshape(-1, 3),
        F.normalize(directions, dim=-1).reshape(-1, 3),
        torch.zeros(7 * count, dtype=torch.long, device=c2w.device),
        told[None],
        maps,
    )
    behind = (1 - seen.opacity).view(7, count, 1) * sight.background
    pictures = seen.colour.view(7, count, 3) + behind
    residual = pictures[0] - sight.colour
    jacobian = ((pictures[1:] - pictures[0]) / steps.diagonal()[:, None, None]).flatten(1)
    weight = (1 + (residual.norm(dim=-1, keepdim=True) / OUTLIER) ** 2) ** -2
    weighted = jacobian * weight.expand(count, 3).reshape(-1)
    return weighted @ jacobian.T, -weighted @ residual.reshape(-1)
