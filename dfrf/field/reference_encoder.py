"""The encoder of the references: pixel-aligned features F_n.

N references of H x W pixels, C feature channels.
"""

from __future__ import annotations

from dataclasses import replace

import torch
import torch.nn.functional as F
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from dfrf.config import FieldConfig
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.field.reference_views import ReferenceViews

BILINEAR_SPREAD = 1 / 3  # px^2 along an axis, by which reading references blurs them
COLOUR = slice(0, 3)  # of the features of a reference
MATTE = 3
MATTE_AND_COLOUR = 4  # channels that are copied, not computed by the network
LEAST_SHOWN = 0.1  # so that weights change slowly where few views show the head


def sharpened(images: Float[Tensor, "N H W 3"]) -> Float[Tensor, "N H W 3"]:
    """Images that are as sharp as before once they have been blurred by s = `BILINEAR_SPREAD`.

    Reading between pixels spreads each of them by 1/6 px^2 in the mean, and slightly misplaced
    references spread it about as much again. The kernel (-s/2, 1 + s, -s/2) has the variance -s and
    undoes that. Values may leave 0..1 at edges. The border is replicated outside the images.
    """
    side = -BILINEAR_SPREAD / 2
    line = images.new_tensor([side, 1 - 2 * side, side])
    kernel = torch.outer(line, line).expand(3, 1, 3, 3)
    padded = F.pad(images.permute(0, 3, 1, 2), (1, 1, 1, 1), mode="replicate")
    return F.conv2d(padded, kernel, groups=3).permute(0, 2, 3, 1)


def shows_head(matte: Float[Tensor, "*B"]) -> Float[Tensor, "*B"]:
    """How much a view counts at a point for showing the head there, and not what is beside it.

    Args:
        matte: of the view at the point, a feature.
    """
    return matte.float().clamp_min(LEAST_SHOWN).square()


class ReferenceEncoder(nn.Module):
    """Two 3x3 convolutions without down-sampling, then a linear layer a pixel.

    The first four channels of the result are the sharpened colour and the matte themselves, so that
    the field can blend the references' own colours.
    """

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        width = config.cnn_width
        self.conv1 = nn.Conv2d(MATTE_AND_COLOUR, width, 3, padding=1)
        self.conv2 = nn.Conv2d(width, width, 3, padding=1)
        self.head = nn.Conv2d(width, config.feature_dim - MATTE_AND_COLOUR, 1)

    def forward(self, views: ReferenceViews) -> ReferenceMaps:
        """The feature table of the references, float32."""
        # One by one: the layers of all of them need not be in memory at once.
        pairs = zip(views.images.split(1), views.mattes.split(1), strict=True)
        table = torch.cat([self.features(image, matte).flatten(0, 2) for image, matte in pairs])
        maps = ReferenceMaps.of(table, views)
        if views.mouths is not None:
            with torch.no_grad():  # people with mouth crops are fine-tuned, without this network
                maps = replace(maps, mouths=self(views.mouths.views))
        return maps

    def features(
        self, images: UInt8[Tensor, "N H W 3"], mattes: UInt8[Tensor, "N H W"]
    ) -> Float[Tensor, "N H W C"]:
        """F_n of images and mattes."""
        matte, colours = mattes[..., None].float() / 255, images.float() / 255
        x = torch.cat([colours, matte], -1).permute(0, 3, 1, 2)
        x = x.contiguous(memory_format=torch.channels_last)
        learned = self.head(F.relu(self.conv2(F.relu(self.conv1(x * 2 - 1)))))
        return torch.cat([sharpened(colours), matte, learned.permute(0, 2, 3, 1)], -1)
