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

from dfrf.field.reference_maps import MIN_WEIGHT, ChosenMouths, ReferenceMaps
from dfrf.field.reference_views import MouthViews

LIP_POINTS = 40
UPPER_RIM, LOWER_RIM = [36, 35, 34], [24, 25, 26]  # of these, the middle of the inner lips
MOUTHS = 64  # crops of a person; 24 lost texture where a head turns
VIEWS = 4  # crops that a point reads
TURN = 0.15  # rad that count as much as the mean difference of the lips of two frames
WIDE = 0.75  # of the root mean square turn of a person's crops, which counts so where it is more
GAP = 3.0  # weight of the gap: a small part of lip motion, but the most visible
FADE = 2  # power by which a view's weight falls with its distance
NEAREST = 4  # power of the weight: a mean of four kinds of teeth shows none
EDGE = 0.7  # of the region's radii, from where its weight falls to 0
BESIDE = 2.5  # of the region's radii: nearer than this, colours come from references alone
HALF_AXES = (1.5, 1.3, 1.5)  # of the region to the side, up and forwards, half mouth widths
NEIGHBOURS = 10  # frames to each side of a training frame, which show nearly the same mouth
KERNEL = 0.1  # head units, range of the motion of a point of the lips
STIFF = 0.02  # added to the diagonal, so that points close together get no large weights
RIDGE = 3.0  # frames' worth


def ramp(values: Float[Tensor, "*B"], start: float, end: float) -> Float[Tensor, "*B"]:
    """0 at the start, 1 at the end, smooth between and constant beyond."""
    x = ((values - start) / (end - start)).clamp(0, 1)
    return x * x * (3 - 2 * x)


def region(shape: Float[Tensor, "Q 3"]) -> tuple[Float[Tensor, 3], Float[Tensor, 3]]:
    """Middle of the mouth region and its half axes, head units."""
    low, high = shape.amin(0), shape.amax(0)
    return (low + high) / 2, (high - low)[0] / 2 * shape.new_tensor(HALF_AXES)


def gap(lips: Float[Tensor, "T Q 2"]) -> Float[Tensor, " T"]:
    """Gap of the inner lips beyond that of the mean face, head units."""
    return (lips[:, LOWER_RIM, 1] - lips[:, UPPER_RIM, 1]).mean(1)


def lip_traits(lips: Float[Tensor, "T Q 2"], among: Float[Tensor, "C Q 2"]) -> Float[Tensor, "T K"]:
    """Numbers whose squared distance is the difference of lips: their positions and their gap.

    Args:
        lips: to compare.
        among: lips of the person; their mean squared distance from their mean is 1 + GAP.
    """
    spread = among.var(0, correction=0).sum().sqrt().clamp_min(MIN_WEIGHT)
    of_gap = gap(among).std(correction=0).clamp_min(MIN_WEIGHT)
    return torch.cat([lips.flatten(1) / spread, GAP**0.5 * gap(lips)[:, None] / of_gap], 1)


def distance(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """Distance of points from the middle of the mouth, 1 on the edge of its region.

    Infinite where no mouth crops are read.
    """
    mouths = maps.views.mouths
    if mouths is None or not maps.chosen:
        return points.new_full((len(points),), torch.inf)
    middle, reach = region(mouths.shape)
    return ((points - middle) / reach).norm(dim=-1)


def share(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """Share of points' colour and features that mouth crops give, 0..1; 0 where none are read."""
    return ramp(distance(maps, points), 1, EDGE)


def nearness(maps: ReferenceMaps, points: Float[Tensor, "M 3"]) -> Float[Tensor, " M"]:
    """1 in the mouth region, falling to 0 beside it, at a `distance` of `BESIDE`."""
    return ramp(distance(maps, points), BESIDE, 1)


def wanted_lips(
    mouths: MouthViews, measures: Float[Tensor, " L"], origin: Float[Tensor, 3]
) -> Float[Tensor, "Q 2"]:
    """Positions of lips with these measures, seen from a viewpoint."""
    inputs = torch.cat([measures, F.normalize(origin, dim=0)])
    return (inputs @ mouths.reading[:-1] + mouths.reading[-1]).view(-1, 2)


def read_measures(
    mouths: MouthViews, lips: Float[Tensor, "F Q 2"], origins: Float[Tensor, "F 3"]
) -> Float[Tensor, "F L"]:
    """The lip measures whose lips, seen from viewpoints, come nearest to given positions."""
    count = len(mouths.reading) - 4
    viewed = F.normalize(origins, dim=-1) @ mouths.reading[count:-1]
    rest = lips.flatten(1) - viewed - mouths.reading[-1]
    return torch.linalg.lstsq(mouths.reading[:count].T, rest.T).solution.T


def fit_reading(
    measures: Float[Tensor, "T L"], c2w: Float[Tensor, "T 3 4"], lips: Float[Tensor, "T Q 2"]
) -> Float[Tensor, "I Q2"]:
    """Ridge regression from lip measures and viewpoints to positions of lips."""
    inputs = torch.cat([measures, F.normalize(c2w[:, :, 3], dim=-1)], 1).double()
    target = lips.flatten(1).double()
    x = inputs - inputs.mean(0)
    square = x.T @ x + torch.diag(RIDGE * x.square().mean(0) + 1e-9)
    weights = torch.linalg.solve(square, x.T @ (target - target.mean(0)))
    return torch.cat([weights, (target.mean(0) - inputs.mean(0) @ weights)[None]]).float()


def turn(viewpoints: Float[Tensor, "P 3"]) -> Float[Tensor, ""]:
    """Turn that counts as much as the mean difference of lips, rad.

    Of a head that turns far there are few crops for each pose, and none of them may show the lips.
    """
    middle = F.normalize(viewpoints.mean(0), dim=0)
    spread = (viewpoints - middle).square().sum(-1).mean().sqrt()
    return (WIDE * spread).clamp_min(TURN)


def gaussians(points: Float[Tensor, "M 2"], at: Float[Tensor, "Q 2"]) -> Float[Tensor, "M Q"]:
    """Gaussians round the points `at`, evaluated at `points`."""
    return torch.exp(-0.5 * (torch.cdist(points, at) / KERNEL) ** 2)


def motion_weights(
    at: Float[Tensor, "Q 2"], motion: Float[Tensor, "n Q 2"]
) -> Float[Tensor, "n Q 2"]:
    """Weights of the Gaussians round points whose sum moves each of them as given."""
    stiff = STIFF * torch.eye(len(at), device=at.device)
    return torch.linalg.solve(gaussians(at, at) + stiff, motion)


def moved(chosen: ChosenMouths, points: Float[Tensor, "M 3"]) -> Float[Tensor, "n M 2"]:
    """Offsets from the projection of points to where the chosen crops show them, pixels."""
    return gaussians(points[:, :2], chosen.at) @ chosen.motion


def nearest(
    mouths: MouthViews,
    maps: ReferenceMaps,
    measures: Float[Tensor, " L"],
    origin: Float[Tensor, 3],
    training_frame: Int[Tensor, ""] | None = None,
) -> ChosenMouths:
    """The few crops with the most similar lips and pose; weights fade before another takes over.

    Args:
        mouths: to choose from.
        maps: of all of them.
        measures: of the wanted lips, as decoded from codes.
        origin: of the camera, head frame.
        training_frame: number of the frame in training, which reads neither itself nor its
            neighbours; None in rendering.
    """
    views = mouths.views
    if training_frame is None:
        wanted = wanted_lips(mouths, measures, origin)
    else:
        wanted = mouths.measured[training_frame]
    traits = lip_traits(torch.cat([mouths.lips, wanted[None]]), mouths.lips)
    of_lips = (traits[:-1] - traits[-1]).square().sum(-1)
    viewpoints = F.normalize(views.c2w[:, :, 3], dim=-1)
    turned = (viewpoints - F.normalize(origin, dim=0)).square().sum(-1) / turn(viewpoints) ** 2
    apart = (of_lips + turned).sqrt()
    if training_frame is not None:
        beside = (mouths.frames - training_frame).abs() <= NEIGHBOURS
        apart = apart.masked_fill(beside, torch.inf)
    apart, chosen = apart.topk(min(VIEWS + 1, len(apart)), largest=False)
    weight = 1 - (apart[:-1] / apart[-1].clamp_min(MIN_WEIGHT)).nan_to_num(1.0) ** FADE
    chosen = chosen[:-1]
    down = wanted.new_tensor([1, -1])
    scale = views.focal / (views.c2w[chosen, :, 3] - region(mouths.shape)[0]).norm(dim=-1)
    at = mouths.shape[:, :2] + wanted * down
    motion = (mouths.lips[chosen] - wanted) * scale[:, None, None]
    return ChosenMouths(
        maps.only(chosen, NEAREST * weight.clamp_min(MIN_WEIGHT).log()),
        at,
        motion_weights(at, motion),
    )
