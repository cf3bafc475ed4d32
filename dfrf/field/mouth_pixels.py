"""Where the pixels of a rendered mouth come from: crops of the clip with similar lips and pose.

The few whole references show few mouths. So a person also keeps crops round the mouths of many
frames. Points near the lips read the crops whose lips and pose are most similar to the wanted ones.
Each crop is warped to the wanted lips first: mouths that coincide keep their texture when blended.

P crops, n of them read, L lip measures, Q = `LIP_POINTS` points of the lips, M points. Positions of
lips are relative to those of the mean face, right and down in the image, head units.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.field.reference_maps import LEAST_WEIGHT, ChosenMouths, ReferenceMaps
from dfrf.field.reference_views import MouthViews

LIP_POINTS = 40
UPPER_RIM, LOWER_RIM = [36, 35, 34], [24, 25, 26]  # of these, the middle of the inner lips
MOUTHS = 64  # crops of a person; 24 lost texture where a head turns
VIEWS = 4  # that a point looks at
TURN = 0.15  # rad that count as much as lips that are as unlike as two frames in the mean
GAP = 3.0  # how much the gap counts: of all that lips do it is little, and what is looked at
FADE = 2  # power by which a view's weight falls with its distance
NEAREST = 4  # power of the weight: a mean of four kinds of teeth shows none
EDGE = 0.7  # of the region's radii, from where its weight falls to nothing
BESIDE = 2.0  # of the region's radii: nearer than this, colours are read off pictures
REACH = (1.5, 1.3, 1.5)  # half axes of the region to the side, up and forwards, half mouth widths
NEIGHBOURS = 10  # frames to each side of one that is learned, which show nearly the same
KERNEL = 0.1  # head units, how far the motion of a point of the lips carries
STIFF = 0.02  # added to the diagonal, so that points close together get no large weights
RIDGE = 3.0  # frames' worth


def ramp(values: Float[Tensor, "*B"], start: float, end: float) -> Float[Tensor, "*B"]:
    """0 at the start, 1 at the end, smooth between and constant beyond."""
    x = ((values - start) / (end - start)).clamp(0, 1)
    return x * x * (3 - 2 * x)


def region(shape: Float[Tensor, "Q 3"]) -> tuple[Float[Tensor, 3], Float[Tensor, 3]]:
    """Middle of the mouth region and its half axes, head units."""
    low, high = shape.amin(0), shape.amax(0)
    return (low + high) / 2, (high - low)[0] / 2 * shape.new_tensor(REACH)


def gap(lips: Float[Tensor, "T Q 2"]) -> Float[Tensor, " T"]:
    """How much further the inner lips are apart than those of the mean face, head units."""
    return (lips[:, LOWER_RIM, 1] - lips[:, UPPER_RIM, 1]).mean(1)


def lip_traits(lips: Float[Tensor, "T Q 2"], among: Float[Tensor, "C Q 2"]) -> Float[Tensor, "T K"]:
    """Numbers whose squared distance tells how unlike lips are: where they are, and their gap.

    Args:
        lips: to be compared.
        among: lips of the person; their squared distance from the mean is 1 + GAP in the mean.
    """
    spread = among.var(0, correction=0).sum().sqrt().clamp_min(LEAST_WEIGHT)
    of_gap = gap(among).std(correction=0).clamp_min(LEAST_WEIGHT)
    return torch.cat([lips.flatten(1) / spread, GAP**0.5 * gap(lips)[:, None] / of_gap], 1)


def distance(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """How far points lie from the middle of the mouth, 1 on the edge of its region.

    Infinitely far where no mouths are looked at.
    """
    mouths = maps.views.mouths
    if mouths is None or not maps.chosen:
        return points.new_full((len(points),), torch.inf)
    middle, reach = region(mouths.shape)
    return ((points - middle) / reach).norm(dim=-1)


def share(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """How much of what is seen of points is read off mouths, 0..1; 0 where none is looked at."""
    return ramp(distance(maps, points), 1, EDGE)


def nearness(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """1 in the mouth region, falling to 0 beside it, at a `distance` of `BESIDE`."""
    return ramp(distance(maps, points), BESIDE, 1)


def wanted_lips(
    mouths: MouthViews, measures: Float[Tensor, " L"], origin: Float[Tensor, 3]
) -> Float[Tensor, "Q 2"]:
    """Where lips with these measures are, seen from a place."""
    seen = torch.cat([measures, F.normalize(origin, dim=0)])
    return (seen @ mouths.reading[:-1] + mouths.reading[-1]).view(-1, 2)


def fit_reading(
    measures: Float[Tensor, "T L"], c2w: Float[Tensor, "T 3 4"], lips: Float[Tensor, "T Q 2"]
) -> Float[Tensor, "I Q2"]:
    """Ridge regression from lip measures and viewpoints to where lips are."""
    inputs = torch.cat([measures, F.normalize(c2w[:, :, 3], dim=-1)], 1).double()
    target = lips.flatten(1).double()
    x = inputs - inputs.mean(0)
    square = x.T @ x + torch.diag(RIDGE * x.square().mean(0) + 1e-9)
    weights = torch.linalg.solve(square, x.T @ (target - target.mean(0)))
    return torch.cat([weights, (target.mean(0) - inputs.mean(0) @ weights)[None]]).float()


def gaussians(points: Float[Tensor, "M 2"], at: Float[Tensor, "Q 2"]) -> Float[Tensor, "M Q"]:
    """Gaussians round some points, at others."""
    return torch.exp(-0.5 * (torch.cdist(points, at) / KERNEL) ** 2)


def motion_weights(
    at: Float[Tensor, "Q 2"], motion: Float[Tensor, "n Q 2"]
) -> Float[Tensor, "n Q 2"]:
    """Weights of the Gaussians round points whose sum moves each of them as given."""
    stiff = STIFF * torch.eye(len(at), device=at.device)
    return torch.linalg.solve(gaussians(at, at) + stiff, motion)


def moved(chosen: ChosenMouths, points: Float[Tensor, "M 3"]) -> Float[Tensor, "n M 2"]:
    """How far beside their projection the chosen crops show points, pixels."""
    return gaussians(points[:, :2], chosen.at) @ chosen.motion


def nearest(
    mouths: MouthViews,
    maps: ReferenceMaps,
    measures: Float[Tensor, " L"],
    origin: Float[Tensor, 3],
    learned: Int[Tensor, ""] | None = None,
) -> ChosenMouths:
    """The few crops with the most similar lips and pose; weights fade before another takes over.

    Args:
        mouths: to choose from.
        maps: of all of them.
        measures: of the lips that are wanted, as they are read off codes.
        origin: of the camera, head frame.
        learned: number of the frame, where it is learned: then neither it nor what is beside it is
            looked at.
    """
    views = mouths.views
    wanted = wanted_lips(mouths, measures, origin) if learned is None else mouths.measured[learned]
    traits = lip_traits(torch.cat([mouths.lips, wanted[None]]), mouths.lips)
    of_lips = (traits[:-1] - traits[-1]).square().sum(-1)
    seen_from = F.normalize(views.c2w[:, :, 3], dim=-1)
    turned = (seen_from - F.normalize(origin, dim=0)).square().sum(-1) / TURN**2
    apart = (of_lips + turned).sqrt()
    if learned is not None:
        apart = apart.masked_fill((mouths.frames - learned).abs() <= NEIGHBOURS, torch.inf)
    apart, chosen = apart.topk(min(VIEWS + 1, len(apart)), largest=False)
    weight = 1 - (apart[:-1] / apart[-1].clamp_min(LEAST_WEIGHT)).nan_to_num(1.0) ** FADE
    chosen = chosen[:-1]
    down = wanted.new_tensor([1, -1])
    scale = views.focal / (views.c2w[chosen, :, 3] - region(mouths.shape)[0]).norm(dim=-1)
    at = mouths.shape[:, :2] + wanted * down
    motion = (mouths.lips[chosen] - wanted) * scale[:, None, None]
    return ChosenMouths(
        maps.only(chosen, NEAREST * weight.clamp_min(LEAST_WEIGHT).log()),
        at,
        motion_weights(at, motion),
    )
