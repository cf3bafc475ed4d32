"""Refining a head's pose until its rendering lies on the picture (analysis by synthesis).

Poses of `prepare` come from the skin of the face and the outline of the head, by way of a mean
face. A learned head knows its own hair, ears and depth: where it is rendered beside the picture,
the pose is wrong. One Gauss-Newton step at a time, as in iNeRF (Yen-Chen et al. 2021), but with
differences in place of gradients: six more renderings of a thousand rays.

B rays. A correction is a rotation vector in radians about the head's origin and a shift in
head units, both in the head frame, by which the camera moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.cameras import Rays, pixel_rays
from dfrf.rendering.volume_rendering import Volume, render_rays

# A third of a pixel or so at the rim of a head of 300 px: beyond rounding, within the detail.
STEPS = (0.004, 0.004, 0.004, 0.004, 0.004, 0.006)
OUTLIER = 0.2  # colour distance at which a residual counts for a quarter


@dataclass(frozen=True)
class PoseObservation:
    """Pixels of one frame that its pose is held to.

    Attributes:
        pixels: column, row.
        colour, background: in 0..1.
        focal: pixels.
        centre: principal point, (column, row).
    """

    pixels: Float[Tensor, "B 2"]
    colour: Float[Tensor, "B 3"]
    background: Float[Tensor, "B 3"]
    focal: float
    centre: Float[Tensor, 2]

    def to(self, device: torch.device) -> PoseObservation:
        """The same on a device."""
        return PoseObservation(
            self.pixels.to(device),
            self.colour.to(device),
            self.background.to(device),
            self.focal,
            self.centre.to(device),
        )


def moved(
    c2w: Float[Tensor, "*#K 3 4"], correction: Float[Tensor, "*#K 6"]
) -> Float[Tensor, "*K 3 4"]:
    """Cameras moved by corrections."""
    x, y, z = correction[..., :3].unbind(-1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).unflatten(-1, (3, 3))
    turned = torch.linalg.matrix_exp(cross) @ c2w
    shift = F.pad(correction[..., 3:, None], (3, 0))
    return turned + shift


@torch.no_grad()
def normal_equations(
    volume: Volume, observation: PoseObservation, c2w: Float[Tensor, "3 4"]
) -> tuple[Float[Tensor, "6 6"], Float[Tensor, 6]]:
    """J^T W J and -J^T W r of one frame at its pose.

    r is the rendering over the background less the picture, W the weights of Geman and McClure's
    loss, so that what moves by itself (lids, strands of hair) counts little.

    Args:
        volume: the head as it is in that frame.
        observation: what the frame shows.
        c2w: its camera.
    """
    if not len(observation.pixels):
        return c2w.new_zeros(6, 6), c2w.new_zeros(6)
    steps = torch.diag(c2w.new_tensor(STEPS))
    cameras = moved(c2w, torch.cat([torch.zeros_like(steps[:1]), steps]))
    count = len(observation.pixels)
    origins, directions = pixel_rays(
        cameras[:, None], observation.focal, observation.centre, observation.pixels
    )
    rays = Rays(
        origins.reshape(-1, 3),
        F.normalize(directions, dim=-1).reshape(-1, 3),
        torch.zeros(7 * count, dtype=torch.long, device=c2w.device),
    )
    rendered = render_rays(volume, rays)
    behind = (1 - rendered.opacity).view(7, count, 1) * observation.background
    pictures = rendered.colour.view(7, count, 3) + behind
    residual = pictures[0] - observation.colour
    jacobian = ((pictures[1:] - pictures[0]) / steps.diagonal()[:, None, None]).flatten(1)
    weight = (1 + (residual.norm(dim=-1, keepdim=True) / OUTLIER) ** 2) ** -2
    weighted = jacobian * weight.expand(count, 3).reshape(-1)
    return weighted @ jacobian.T, -weighted @ residual.reshape(-1)
