"""Refines a head's pose until its rendering coincides with the image (analysis by synthesis).

Poses of `prepare` come from the skin of the face and the outline of the head, by way of a mean
face. A fine-tuned head has the person's own hair, ears and depth: where its rendering is offset
from the image, the pose is wrong. One Gauss-Newton step at a time, as in iNeRF (Yen-Chen et al.
2021), but without gradients through the field: the slope of the image from pixel to pixel, and the
motion of each visible point in the image, give the change of the image with the pose.

B pixels. A correction is a rotation vector in radians about the head's origin and a shift in
head units, both in the head frame, by which the camera moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor

from dfrf.cameras import Rays, pixel_rays, project
from dfrf.device import Movable
from dfrf.rendering.frame_head import FrameHead

APART = 0.5  # px between the rays whose difference is the slope of the image
STEP = 1e-3  # of a correction: its effect on the position of a point is nearly linear
VISIBLE_OPACITY = 0.1  # sum over three rays, from which they see the head
OUTLIER = 0.2  # colour distance at which a residual counts for a quarter


@dataclass(frozen=True)
class PoseObservation(Movable):
    """Pixels of one frame that its pose is fitted to.

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
    head: FrameHead, observation: PoseObservation, c2w: Float[Tensor, "3 4"]
) -> tuple[Float[Tensor, "6 6"], Float[Tensor, 6]]:
    """J^T W J and -J^T W r of one frame at its pose.

    r is the rendering over the background minus the image, W the weights of Geman and McClure's
    loss, so that parts with their own motion (lids, strands of hair) count little.

    Args:
        head: in that frame.
        observation: pixels of the frame.
        c2w: its camera.
    """
    if not len(observation.pixels):
        return c2w.new_zeros(6, 6), c2w.new_zeros(6)
    count = len(observation.pixels)
    beside = APART * c2w.new_tensor([[[0.0, 0.0]], [[1.0, 0.0]], [[0.0, 1.0]]])
    origins, directions = pixel_rays(
        c2w, observation.focal, observation.centre, observation.pixels + beside
    )
    rays = Rays(
        origins.reshape(-1, 3),
        F.normalize(directions, dim=-1).reshape(-1, 3),
        torch.zeros(3 * count, dtype=torch.long, device=c2w.device),
    )
    rendered = head.see(rays)
    opacity = rendered.opacity.view(3, count)
    behind = (1 - opacity[..., None]) * observation.background
    images = rendered.colour.view(3, count, 3) + behind
    slope = (images[1:] - images[0]) / APART
    # At the rim one of the three may see nothing: the others give its distance.
    total = opacity.sum(0)
    depth = rendered.depth.view(3, count).sum(0) / total.clamp_min(VISIBLE_OPACITY)
    points = rays.origins[:count] + depth[:, None] * rays.directions[:count]
    motion = point_motion(points, observation, c2w) * (total > VISIBLE_OPACITY)[:, None]
    # A pixel of an image that moves by d shows what was d before it, hence the sign.
    jacobian = -(motion.unsqueeze(-1) * slope.movedim(0, 1)).sum(2).flatten(1)
    residual = images[0] - observation.colour
    weight = (1 + (residual.norm(dim=-1, keepdim=True) / OUTLIER) ** 2) ** -2
    weighted = jacobian * weight.expand(count, 3).reshape(-1)
    return weighted @ jacobian.T, -weighted @ residual.reshape(-1)


def point_motion(
    points: Float[Tensor, "B 3"], observation: PoseObservation, c2w: Float[Tensor, "3 4"]
) -> Float[Tensor, "6 B 2"]:
    """Motion of points of the head in the image for each number of a correction, px."""
    steps = STEP * torch.eye(6, device=c2w.device)
    cameras = moved(c2w, torch.cat([torch.zeros_like(steps[:1]), steps]))
    places = project(points, cameras, observation.focal, observation.centre[None])
    return (places[1:] - places[0]) / STEP
