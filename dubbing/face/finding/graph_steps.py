"""The steps that networks are made of: each takes its settings and constants, and gives a function.

Of the operators that only one family of networks has, `box` is called Landmarks2TransformMatrix
there, `crop` TransformTensorBilinear and `transform` TransformLandmarks.

Letters: N images, C channels, H and W pixels, G parts side by side in the channels, P points.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor

VIEWS = ("take", "reshape")  # steps whose result may share its memory with their input
OUTSIDE = -2.0  # a place that no image has, in grid_sample's unit

Settings = dict[str, Any]
Run = Callable[..., Tensor]


def _convolve(settings: Settings, weight: Tensor, bias: Tensor) -> Run:
    before, after = settings["padding"]
    stride, groups = settings["stride"], settings["groups"]
    if groups == len(weight) and before < after:
        # A row and a column of zeros in the filter are faster than unequal edges of the image.
        weight, before = F.pad(weight, (1, 0, 1, 0)), after
    weight = weight.contiguous(memory_format=torch.channels_last)
    then: Run = F.relu6 if settings.get("then") == "relu6" else lambda x: x
    if before == after:
        return lambda x: then(F.conv2d(x, weight, bias, stride, before, 1, groups))
    sides = (before, after, before, after)
    return lambda x: then(F.conv2d(F.pad(x, sides), weight, bias, stride, 0, 1, groups))


def _convolve_transposed(settings: Settings, weight: Tensor, bias: Tensor) -> Run:
    """Without overlap: each pixel becomes a square. One product is faster than torch's own."""
    size, channels = settings["stride"], weight.shape[1]
    flat = weight.flatten(1).mT.contiguous()
    bias = bias[:, None, None]

    def run(x: Tensor) -> Tensor:
        count, _, height, width = x.shape
        squares = flat @ x.permute(1, 0, 2, 3).flatten(1)
        squares = squares.view(channels, size, size, count, height, width)
        out = squares.permute(3, 0, 4, 1, 5, 2).reshape(count, channels, height * size, -1)
        return out.add_(bias)

    return run


def _add_narrow(settings: Settings) -> Run:
    """Adds (N, G c, H, W) to the first c of each part's channels of (N, G C, H, W)."""
    parts, in_place = settings.get("parts", 1), settings["in_place"]

    def run(narrow: Tensor, wide: Tensor) -> Tensor:
        wide = wide if in_place else wide.clone()
        shape = (parts, -1)
        narrow = narrow.unflatten(1, shape)
        wide.unflatten(1, shape)[:, :, : narrow.shape[2]].add_(narrow)
        return wide

    return run


def _reshape(settings: Settings) -> Run:
    """New shape of what lies in memory as (N, H, W, C)."""
    shape = settings["shape"]

    def run(x: Tensor) -> Tensor:
        x = x.permute(0, 2, 3, 1) if x.dim() == 4 else x
        return x.reshape(len(x), *shape)

    return run


def _take(settings: Settings) -> Run:
    """Some of G parts that lie side by side in the channels."""
    parts, places = settings["parts"], settings["places"]
    if len(places) == 1:
        return lambda x: x.chunk(parts, 1)[places[0]]
    return lambda x: torch.cat([x.chunk(parts, 1)[place] for place in places], 1)


def _box(settings: Settings) -> Run:
    """Boxes round groups of points (N, P, 3), as maps (N, 2 G, 3) from a box's pixels to points.

    A box is as wide and high as its group, times `scale`, and turned with the line between two
    points, `ends`.
    """
    size, scale = settings["size"], settings["scale"]
    most = max(map(len, settings["points"]))
    groups = torch.tensor([g + g[-1:] * (most - len(g)) for g in settings["points"]])
    ends = torch.tensor(settings["ends"])

    def run(points: Tensor) -> Tensor:
        flat = points[:, :, :2]
        right, down = (flat[:, ends[:, 1]] - flat[:, ends[:, 0]]).unbind(-1)  # (N, G)
        length = torch.hypot(right, down)
        cosine = torch.where(length > 0, right / length, torch.ones_like(length))
        sine = torch.where(length > 0, down / length, torch.zeros_like(length))
        axes = torch.stack((cosine, -sine, sine, cosine), -1).unflatten(-1, (2, 2))  # (N, G, 2, 2)
        turned = flat[:, groups] @ axes
        low, high = turned.amin(2), turned.amax(2)
        middle = (axes @ ((low + high) / 2)[..., None])[..., 0]
        axes = axes * ((high - low) * scale / size)[:, :, None]
        shift = middle - axes.sum(-1) * (size / 2)
        return torch.cat((axes, shift[..., None]), -1).flatten(1, 2)

    return run


def _crop(settings: Settings) -> Run:
    """Cuts boxes (N, 2 G, 3) out of images (N, C, H, W): (N, G C, S, S); 0 outside of them."""
    size, parts = settings["size"], settings.get("parts", 1)
    row, column = torch.meshgrid(torch.arange(size) + 0.5, torch.arange(size) + 0.5, indexing="ij")
    places = torch.stack((column, row, torch.ones_like(row)), -1).reshape(-1, 3)

    def run(images: Tensor, boxes: Tensor) -> Tensor:
        last = torch.tensor(images.shape[:1:-1]) - 1
        grid = (places @ boxes.unflatten(1, (parts, 2)).transpose(2, 3)) - 0.5
        inside = ((grid >= 0) & (grid <= last)).all(-1, keepdim=True)
        grid = torch.where(inside, grid * (2 / last) - 1, OUTSIDE - 1.0)  # (N, G, S S, 2)
        cut = F.grid_sample(images, grid, align_corners=True)  # (N, C, G, S S)
        cut = cut.transpose(1, 2).flatten(1, 2).unflatten(2, (size, size))
        return cut.contiguous(memory_format=torch.channels_last)

    return run


def _plain(run: Run) -> Callable[..., Run]:
    """A step without settings."""
    return lambda settings: run


STEPS: dict[str, Callable[..., Run]] = {
    "convolve": _convolve,
    "convolve_transposed": _convolve_transposed,
    "prelu": lambda settings, slope: partial(F.prelu, weight=slope),
    "relu": lambda settings: torch.relu_ if settings["in_place"] else torch.relu,
    "hardswish": lambda settings: partial(F.hardswish, inplace=settings["in_place"]),
    "sigmoid": _plain(torch.sigmoid),
    "add": _plain(torch.add),
    "add_narrow": _add_narrow,
    "multiply": _plain(torch.mul),
    "scale": lambda settings, factor: lambda x: x * factor,
    "max_pool": lambda settings: partial(F.max_pool2d, kernel_size=settings["size"]),
    "average_pool": lambda settings: partial(F.avg_pool2d, kernel_size=settings["size"]),
    "resize": lambda settings: partial(
        F.interpolate, size=settings["size"], mode="bilinear", align_corners=False
    ),
    "concatenate": _plain(lambda *xs: torch.cat(xs, 1)),
    "reshape": _reshape,
    "take": _take,
    "box": _box,
    "crop": _crop,
    # Points (N, P, 2) moved by maps (N, 2, 3).
    "transform": _plain(lambda points, maps: points @ maps[:, :, :2].mT + maps[:, None, :, 2]),
}
