"""Reads a person's views as images: at the vertices of a frame, and between them.

h x w vertices of a window into the frame, H x W pixels of it, C channels, P vertices of all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from dfrf.field.reference_encoder import MATTE, shows_head
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.rendering.frame_renderer import BLOCK, grown

LEAST_SHARE = 1e-6  # of the views of a group together


@dataclass(frozen=True)
class ViewImages:
    """Colours and mattes of a person's views as images.

    Attributes:
        whole: the references.
        mouths: the crops round the mouth; empty without.
    """

    whole: Float[Tensor, "N 4 _ _"]
    mouths: Float[Tensor, "M 4 _ _"]

    @classmethod
    def of(cls, maps: ReferenceMaps) -> Self:
        """Those of maps."""
        whole = images(maps)
        return cls(whole, whole[:0] if maps.mouths is None else images(maps.mouths))

    def chosen(self, maps: ReferenceMaps) -> list[list[Float[Tensor, "4 _ _"]]]:
        """Those that the maps of one frame read, in the order of `Shading`: whole, and mouths."""
        mouths = [self.mouths[i] for one in maps.chosen for i in one.maps.number]
        return [[self.whole[i] for i in maps.number], mouths]


def images(maps: ReferenceMaps) -> Float[Tensor, "N 4 _ _"]:
    """Colours and mattes of all views in the table of maps."""
    table = maps.features.view(-1, maps.height, maps.width, maps.features.shape[1])
    return table[..., : MATTE + 1].movedim(-1, 1).float().contiguous()


def sampled(image: Float[Tensor, "C _ _"], place: Float[Tensor, "H W 2"]) -> Float[Tensor, "C H W"]:
    """An image at places (`unit`)."""
    place = place[None]
    return F.grid_sample(image[None], place, padding_mode="border", align_corners=True)[0]


def unit(positions: Float[Tensor, "k 2"], image: Float[Tensor, "4 _ _"]) -> Float[Tensor, "k 2"]:
    """Positions (column, row) as `grid_sample` takes them."""
    height, width = image.shape[1:]
    return positions * 2 / positions.new_tensor([width - 1, height - 1]) - 1


def range_of(some: Bool[Tensor, " n"]) -> slice:
    """From the first to the last that is true."""
    at = some.nonzero()
    return slice(int(at[0]), int(at[-1]) + 1)


def between(values: Float[Tensor, "C h w"]) -> Float[Tensor, "C H W"]:
    """Values of all pixels from the first vertex to the last."""
    size = [BLOCK * (n - 1) + 1 for n in values.shape[1:]]
    return F.interpolate(values[None], size, mode="bilinear", align_corners=True)[0]


def group(
    views: list[Float[Tensor, "4 _ _"]],
    shares: Float[Tensor, "k P"],
    positions: Float[Tensor, "k P 2"],
) -> Float[Tensor, "C P"]:
    """Numbers of views at vertices, to interpolate: their share, then weight and position of each.

    Weights are without the views' mattes, which change from pixel to pixel, and add up to 1.
    """
    places = [unit(p, image) for p, image in zip(positions, views, strict=True)]
    mattes = [sampled(i[MATTE:], p[None])[0, 0] for i, p in zip(views, places, strict=True)]
    weights = shares / shows_head(torch.stack(mattes))
    weights = weights / weights.sum(0).clamp_min(LEAST_SHARE)
    parts = [torch.cat([w[None], p.T]) for w, p in zip(weights, places, strict=True)]
    return torch.cat([shares.sum(0)[None], *parts])


def read(
    views: list[Float[Tensor, "4 _ _"]], shown: Float[Tensor, "C h w"]
) -> Float[Tensor, "3 H W"]:
    """Colours of all pixels that come from some views, times the share of these views.

    Args:
        views: images.
        shown: see `group`.
    """
    share = between(shown[:1])
    total = share.new_zeros(4, *share.shape[1:])  # of weighted colours, and of the weights
    for image, part in zip(views, shown[1:].unflatten(0, (-1, 3)), strict=True):
        counts = grown(part[0] > 0, 1)
        if not counts.any():
            continue
        across = [range_of(counts.any(axis)) for axis in (1, 0)]
        fine = between(part[:, *across])
        seen = sampled(image, fine[1:].movedim(0, -1))
        weight = fine[:1] * shows_head(seen[MATTE:])
        rows, columns = (slice(BLOCK * i.start, BLOCK * (i.stop - 1) + 1) for i in across)
        seen[MATTE:] = 1
        total[:, rows, columns].addcmul_(weight, seen)
    return total[:MATTE].mul_(share / total[MATTE:].clamp_min(LEAST_SHARE))
