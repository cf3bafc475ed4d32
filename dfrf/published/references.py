"""Pixel-aligned reference features F_n, and reading them at projected points.

N references of H x W pixels, C feature channels, P points. Feature maps are channels last, so that
one look-up reads contiguous memory. Positions are (column, row) and integers are pixel centres.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from dfrf.field.encodings import REFERENCE_OCTAVES, encoded_size, frequency_encoding


def clamp_to_image(
    positions: Float[Tensor, "*B 2"], height: int, width: int
) -> Float[Tensor, "*B 2"]:
    """Moves positions (column, row) to the nearest place between the outermost pixel centres."""
    limit = positions.new_tensor([width - 1, height - 1])
    # NaN would become an arbitrary index: the loss reports it, nothing outside the image is read.
    return torch.minimum(positions.nan_to_num().clamp_min(0), limit)


def nearest(
    maps: Float[Tensor, "N H W C"], positions: Float[Tensor, "N *P 2"]
) -> Float[Tensor, "N *P C"]:
    """Features of the pixel nearest to each position; outside the image, of its border.

    Differentiable in the maps, not in the positions.
    """
    count, height, width, channels = maps.shape
    pixel = clamp_to_image(positions.detach().round(), height, width).long()
    first = torch.arange(count, device=maps.device) * (height * width)
    index = pixel[..., 1] * width + pixel[..., 0]
    index = index + first.view(-1, *[1] * (index.dim() - 1))
    return maps.reshape(-1, channels)[index]


def bilinear(
    maps: Float[Tensor, "N H W C"], positions: Float[Tensor, "N *P 2"]
) -> Float[Tensor, "N *P C"]:
    """Features between the four pixels round each position: the soft index of section 3.3.

    The border is replicated outside. Differentiable in the maps and in the positions.
    """
    count, height, width, channels = maps.shape
    size = positions.new_tensor([width, height])
    # grid_sample counts from -1 to 1 between the outer edges of the outermost pixels.
    grid = (2 * positions + 1) / size - 1
    sampled = F.grid_sample(
        maps.permute(0, 3, 1, 2),
        grid.reshape(count, -1, 1, 2),
        mode="bilinear",
        padding_mode="border",
        align_corners=False,
    )
    return sampled.squeeze(-1).transpose(1, 2).reshape(*positions.shape[:-1], channels)


def reference_input(
    images: Float[Tensor, "N H W 3"],
    origins: Float[Tensor, "N 3"],
    octaves: int = REFERENCE_OCTAVES,
) -> Float[Tensor, "N D H W"]:
    """Input of the CNN: encoded colours (0..1), then the encoded camera centre at every pixel."""
    count, height, width, _ = images.shape
    colours = frequency_encoding(images, octaves)
    where = frequency_encoding(origins, octaves)[:, None, None].expand(count, height, width, -1)
    return torch.cat([colours, where], -1).permute(0, 3, 1, 2)


class ReferenceCNN(nn.Module):
    """Two 3x3 convolutions without down-sampling, then one linear layer a pixel.

    Args:
        width: channels of the convolutions.
        feature_dim: C.
        octaves: of the encodings of colour and camera centre.
    """

    def __init__(
        self, width: int = 64, feature_dim: int = 128, octaves: int = REFERENCE_OCTAVES
    ) -> None:
        super().__init__()
        self.octaves = octaves
        self.conv1 = nn.Conv2d(2 * encoded_size(octaves), width, kernel_size=3, padding=1)
        self.conv2 = nn.Conv2d(width, width, kernel_size=3, padding=1)
        self.out = nn.Linear(width, feature_dim)

    def forward(
        self, images: Float[Tensor, "N H W 3"], origins: Float[Tensor, "N 3"]
    ) -> Float[Tensor, "N H W C"]:
        """Feature maps of reference images (0..1) seen from camera centres in the world."""
        x = reference_input(images, origins, self.octaves)
        x = F.relu(self.conv2(F.relu(self.conv1(x))))
        return self.out(x.permute(0, 2, 3, 1))
