"""Augmentation of people: mirrored, in another light, with references of other resolutions.

An `Augmentation` is drawn for a step. It changes all of the step's rays and reference views; the
images in memory stay as they are. B rays, F frames, N references.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
import torch.nn.functional as F
from jaxtyping import Float, UInt8
from torch import Tensor

from dfrf.cameras import Rays
from dfrf.data.dataset import MIRRORED_EXPRESSION
from dfrf.data.ray_batch import SurfaceRays
from dfrf.field.reference_views import ReferenceViews
from dfrf.training.ray_share import RayShare

# Largest changes, up and down alike: the person as filmed lies in the middle.
GAIN = 0.25  # of the logarithm of the exposure
GAMMA = 0.2  # of the logarithm of the exponent
TINT = 0.08  # of the logarithm of a channel
MIXING = 0.08  # share of its difference to another channel that a channel takes on
RESIZED = math.log(1.25)  # of the logarithm of the references' scale
CUT_PROBABILITY = 0.25  # of a step to have its references cropped
MAX_CUT = 0.1  # of a side, at either end


@dataclass(frozen=True)
class Augmentation:
    """Changes to how a person looks in a step.

    Attributes:
        mirrored: in the plane x = 0 of the head frame.
        gamma, mixing: of colours in 0..1, mixing @ colour ** gamma.
        scale: of the references' resolution.
        cuts: shares of the reference that are cut off left, top, right and bottom.
    """

    mirrored: bool
    gamma: float
    mixing: Float[Tensor, "3 3"]
    scale: float
    cuts: tuple[float, float, float, float]

    def colour(self, filmed: UInt8[Tensor, "*B 3"]) -> UInt8[Tensor, "*B 3"]:
        """Colours in this light."""
        grades = 255 * torch.linspace(0, 1, 256, device=filmed.device).pow(self.gamma)
        # By a table and channel by channel: four references are a million values in every step.
        planes = filmed.movedim(-1, 0).contiguous().int()
        mixed = self.mixing.to(grades) @ grades.index_select(0, planes.view(-1)).view(3, -1)
        lit = mixed.add_(0.5).clamp_(0, 255).to(torch.uint8)
        return lit.view(planes.shape).movedim(0, -1)

    def of_share(self, share: RayShare) -> RayShare:
        """A share of a step's rays with these changes; its speech stays."""
        both = torch.stack([share.batch.colour, share.batch.background])
        colour, background = self.colour((255 * both).round().to(torch.uint8)).float() / 255
        share = replace(share, batch=replace(share.batch, colour=colour, background=background))
        return mirrored_share(share) if self.mirrored else share

    def of_views(self, views: ReferenceViews) -> ReferenceViews:
        """Reference views with these changes."""
        views = resized(cut(views, self.cuts), self.scale)
        views = replace(views, images=self.colour(views.images))
        return mirrored_views(views) if self.mirrored else views


def draw_augmentation(generator: torch.Generator) -> Augmentation:
    """Draws the changes of a step, always with the same number of random numbers."""
    mirrored, often, gain, gamma, scale, *rest = torch.rand(18, generator=generator).tolist()
    tints, others, edges = rest[:3], rest[3:9], rest[9:]

    def spread(most: float, drawn: float) -> float:
        return most * (2 * drawn - 1)

    # Rows that add up to 1 leave grey as it is: a turn of the hue, more or less colourful.
    mixing = torch.zeros(3, 3)
    mixing[~torch.eye(3, dtype=torch.bool)] = torch.tensor([spread(MIXING, o) for o in others])
    mixing += torch.diag(1 - mixing.sum(1))
    light = torch.tensor([math.exp(spread(GAIN, gain) + spread(TINT, t)) for t in tints])
    left, top, right, bottom = (MAX_CUT * e if often < CUT_PROBABILITY else 0.0 for e in edges)
    return Augmentation(
        mirrored=mirrored < 0.5,
        gamma=math.exp(spread(GAMMA, gamma)),
        mixing=light[:, None] * mixing,
        scale=math.exp(spread(RESIZED, scale)),
        cuts=(left, top, right, bottom),
    )


def mirror(vectors: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3"]:
    """Points or directions of the head frame, mirrored in the plane x = 0."""
    return vectors * vectors.new_tensor([-1, 1, 1])


def mirrored_expression(expression: Float[Tensor, "*B U"]) -> Float[Tensor, "*B U"]:
    """Measures of the upper face of a mirrored person."""
    order, signs = zip(*MIRRORED_EXPRESSION, strict=True)
    return expression[..., list(order)] * expression.new_tensor(signs)


def mirrored_rays(rays: Rays) -> Rays:
    """Rays from the mirrored place in the mirrored direction."""
    return Rays(mirror(rays.origins), mirror(rays.directions), rays.frame)


def mirrored_share(share: RayShare) -> RayShare:
    """A share with mirrored rays; their colours stay, so the person is mirrored."""
    rays = mirrored_rays(share.batch.rays)
    width = len(MIRRORED_EXPRESSION)
    codes, expression = share.conditioning[:, :-width], share.conditioning[:, -width:]
    return replace(
        share,
        batch=replace(share.batch, origins=rays.origins, directions=rays.directions),
        conditioning=torch.cat([codes, mirrored_expression(expression)], -1),
        surface=SurfaceRays(mirrored_rays(share.surface.rays), share.surface.distance),
    )


def mirrored_views(views: ReferenceViews) -> ReferenceViews:
    """The views of a mirrored camera: M [R | t] M in the head frame, M = diag(-1, 1, 1)."""
    column, row = views.centres.unbind(-1)
    # (M R M | M t): both the row and the column of x change their sign.
    rotation = mirror(views.c2w[:, :, :3]) * views.c2w.new_tensor([-1, 1, 1])[:, None]
    return replace(
        views,
        images=views.images.flip(2),
        mattes=views.mattes.flip(2),
        c2w=torch.cat([rotation, mirror(views.c2w[:, :, 3])[..., None]], -1),
        # Integers are pixel centres: the last column is the first one's mirror image.
        centres=torch.stack([views.images.shape[2] - 1 - column, row], -1),
    )


def cut(views: ReferenceViews, cuts: tuple[float, float, float, float]) -> ReferenceViews:
    """Views cropped by shares of their left, top, right and bottom."""
    height, width = views.mattes.shape[1:]
    left, right = (round(width * share) for share in (cuts[0], cuts[2]))
    top, bottom = (round(height * share) for share in (cuts[1], cuts[3]))
    rows, columns = slice(top, height - bottom), slice(left, width - right)
    return replace(
        views,
        images=views.images[:, rows, columns],
        mattes=views.mattes[:, rows, columns],
        centres=views.centres - views.centres.new_tensor([left, top]),
    )


def resized(views: ReferenceViews, scale: float) -> ReferenceViews:
    """Views of `scale` times as many pixels a side, rounded down."""
    layers = torch.cat([views.images, views.mattes[..., None]], -1).permute(0, 3, 1, 2)
    layers = F.interpolate(
        layers, scale_factor=scale, mode="bilinear", antialias=scale < 1, align_corners=False
    ).permute(0, 2, 3, 1)
    return replace(
        views,
        images=layers[..., :3],
        mattes=layers[..., 3],
        focal=views.focal * scale,
        # Pixels are squares round their integer centres: edges are scaled, not centres.
        centres=(views.centres + 0.5) * scale - 0.5,
        scale=views.scale * scale,
    )
