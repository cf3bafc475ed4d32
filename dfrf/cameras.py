"""Pinhole cameras: rays through pixels, and projection, equation (1).

The camera looks along -z with x right and y up (OpenGL). Pixels are (column, row), and integers
are pixel centres: there is no half-pixel shift. A camera is a rigid camera-to-world matrix (3, 4),
a focal length in pixels and a principal point (column, row).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.device import Movable

# Depths closer to the camera plane than this are moved away from it: nothing divides by zero.
MIN_DEPTH = 1e-6


@dataclass(frozen=True)
class Rays(Movable):
    """R rays in the head frame.

    Attributes:
        origins: where they begin.
        directions: of unit length.
        frame: index of the frame that each ray belongs to.
    """

    origins: Float[Tensor, "R 3"]
    directions: Float[Tensor, "R 3"]
    frame: Int[Tensor, " R"]


@dataclass(frozen=True)
class Camera:
    """A camera that takes square images.

    Attributes:
        c2w: camera to head frame.
        focal: pixels.
        centre: principal point, (column, row).
        size: side of the image, pixels.
    """

    c2w: Float[Tensor, "3 4"]
    focal: float
    centre: Float[Tensor, 2]
    size: int

    def rays(self, pixels: Int[Tensor, " P"]) -> Rays:
        """Rays through pixels, counted row by row; all of them of frame 0."""
        return self.rays_at(pixels // self.size, pixels % self.size)

    def rays_at(self, rows: Int[Tensor, " P"], columns: Int[Tensor, " P"]) -> Rays:
        """Rays through places that may lie outside of the image; all of them of frame 0."""
        count = rows.numel()
        position = torch.stack([columns, rows], -1).float()
        origins, directions = pixel_rays(
            self.c2w.expand(count, 3, 4), self.focal, self.centre.expand(count, 2), position
        )
        return Rays(origins, F.normalize(directions, dim=-1), torch.zeros_like(rows))


def pixel_rays(
    c2w: Float[Tensor, "*#B 3 4"],
    focal: float | Float[Tensor, "*#B"],
    centre: Float[Tensor, "*#B 2"],
    pixels: Float[Tensor, "*#B 2"],
) -> tuple[Float[Tensor, "*B 3"], Float[Tensor, "*B 3"]]:
    """Rays through pixels; all leading dimensions are broadcast.

    Args:
        c2w: camera to world, one for all rays or one a ray.
        focal: pixels.
        centre: principal point, (column, row).
        pixels: (column, row).

    Returns:
        Origins and directions in the world. A direction is not normalised: its component along the
        viewing axis is 1, so that distances along it are depths.
    """
    focal = torch.as_tensor(focal, dtype=pixels.dtype, device=pixels.device)
    plane = (pixels - centre) / focal[..., None]
    local = torch.stack([plane[..., 0], -plane[..., 1], -torch.ones_like(plane[..., 0])], -1)
    directions = (c2w[..., :3] * local[..., None, :]).sum(-1)
    return c2w[..., 3].expand(directions.shape), directions


def pixel_grid(
    height: int, width: int, device: torch.device | str | None = None
) -> Float[Tensor, "H W 2"]:
    """(column, row) of every pixel, row by row."""
    rows, columns = torch.meshgrid(
        torch.arange(height, device=device), torch.arange(width, device=device), indexing="ij"
    )
    return torch.stack([columns, rows], -1).float()


def project(
    points: Float[Tensor, "*P 3"],
    c2w: Float[Tensor, "N 3 4"],
    focal: float | Float[Tensor, "#N"],
    centre: Float[Tensor, "#N 2"],
) -> Float[Tensor, "N *P 2"]:
    """M(p, K_n, R_n, T_n) of equation (1): where each view sees each point.

    Args:
        points: world points, the same for all views.
        c2w: camera to world of N views.
        focal: pixels, of all views or of each.
        centre: principal points (column, row), of all views or of each.

    Returns:
        (column, row), not clamped to the image. Points behind a camera project through its centre.
    """
    count = c2w.shape[0]
    focal = torch.as_tensor(focal, dtype=points.dtype, device=points.device).reshape(-1, 1)
    axes = c2w[:, :, :3].transpose(1, 2)
    # Rounded to bfloat16, a product would be half a pixel off at the edge of a face.
    with torch.autocast(points.device.type, enabled=False):
        # The inverse of a rigid motion: R^T p - R^T t, a column a point.
        local = axes @ points.reshape(-1, 3).T - axes @ c2w[:, :, 3:]
    across, up, depth = local.unbind(1)
    depth = torch.where(depth.abs() < MIN_DEPTH, torch.full_like(depth, -MIN_DEPTH), depth)
    columns = centre[:, None, 0] - focal * across / depth
    rows = centre[:, None, 1] + focal * up / depth
    return torch.stack([columns, rows], -1).reshape(count, *points.shape[:-1], 2)
