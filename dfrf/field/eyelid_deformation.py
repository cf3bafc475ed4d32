"""Lids close as skin does, and a shut eye is the person's own.

Fifteen seconds show two or three blinks, and references hardly ever one. A field that is only told
how far the lids are open has to paint a shut eye from those few frames. Told where the skin of the
lid came from, it need not; and the skin that unfolds as a lid shuts, which open eyes do not show,
is read off a frame of a blink, kept beside the references.

Above the rim of the upper lid, up to where its motion ends below the brow, skin is stretched; below
it the eye stays where it is and disappears behind the lid. A rim is a parabola between the corners
of its eye.

The eyes of a person are a (2, 7) tensor in head units, y up, the image's left one first: x and y of
the left corner, x and y of the right corner, how far below the line between them the lower rim lies
in the middle, how far above it the motion of the lid ends, and how far the rims are apart at rest.
M points, N references.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from dfrf.field import brow_deformation as brows

MEASURES = slice(0, 2)  # of the upper face: the left and the right lid, in LENGTH
LENGTH = 0.1  # of the distance between the outer corners of the eyes: a blink is about -1
RIM = 0.012  # head units from lid to eye: a pixel or two
WHITE = 0.012  # head units: the eye's white is seen so far below the points of the lower lid
# Head units: as far open FaceMesh finds an eye that is shut, from the same line.
SHUT = 0.02 * brows.EYE_DISTANCE + WHITE
WIDEST = 1.5  # times the opening at rest: what is measured beyond is taken for this
LEAST = 1e-3  # head units, no length is divided by less
# How far a lid is shut, from where to where it, and the eye under it, pass to a view of shut eyes.
LID_PASSES, EYE_PASSES = (0.3, 0.6), (0.5, 0.8)
SOFT = 0.3  # of half the lid's width, beside it, and of its height: one view goes over into others
BELOW = 0.05  # head units below the lower rim that skin moves in a blink
SHUT_SHARE = 0.15  # of the opening at rest: an eye that is less open is shut
BESIDE = 0.1  # head units above the motion's end that brows may have lifted its skin


def openings(eyes: Tensor, measures: Tensor) -> Tensor:
    """How far apart the rims of the lids are in the middle, (..., 2) head units.

    Args:
        eyes: (2, 7).
        measures: (..., 2) of the left and of the right lid.
    """
    rest = eyes[:, 6]
    measured = rest + measures * (LENGTH * brows.EYE_DISTANCE)
    # Eyes that are hardly open at rest do not flutter with every error of the measure.
    way = torch.maximum(rest - SHUT, rest / 3).clamp_min(LEAST)
    share = (measured - SHUT) / way
    return rest * share.clamp(0, WIDEST)


class _Place(NamedTuple):
    """Where points (...) are beside the eye of their side of the head."""

    side: Tensor  # 0 left, 1 right
    across: Tensor  # -1 and 1 at the corners of the eye
    bulge: Tensor  # 1 in the middle of the eye, 0 from its corners on outwards
    height: Tensor  # above the lower rim, head units
    top: Tensor  # so far above the lower rim the motion of the lid ends


def _placed(points: Tensor, eyes: Tensor) -> _Place:
    x, y, z = points.unbind(-1)
    side = (x > 0).long()
    left, left_height, right, right_height, lower, end, _ = eyes[side].unbind(-1)
    u = (2 * x - left - right) / (right - left).clamp_min(LEAST)
    bulge = (1 - u * u).clamp_min(0) * brows.ramp(z, brows.EAR, brows.FRONT)
    line = (left_height + right_height) / 2 + u * (right_height - left_height) / 2
    return _Place(side, u, bulge, y - (line - lower * bulge), end + lower * bulge)


def lifts(points: Tensor, eyes: Tensor, own: Tensor, theirs: Tensor) -> Tensor:
    """How much further up skin is than where each reference shows it, (N, M) head units.

    Args:
        points: (N or 1, M, 3), with their brows where each reference has them.
        eyes: (2, 7).
        own: (M or 1, 2) measures of the lids in the frame of each point.
        theirs: (N, 2) measures in the references.
    """
    at, own = _placed(points, eyes), openings(eyes, own)
    mine = own.expand(points.shape[1], 2).gather(1, at.side[0, :, None])[:, 0] * at.bulge
    their = openings(eyes, theirs)[:, at.side[0]] * at.bulge
    # From the rim to the end of the motion, the skin of the lid comes to rest.
    way = (at.top - mine).clamp_min(LEAST)
    lid = (1 - ((at.height - mine) / way).clamp(0, 1)) * (mine - their)
    # An eye stays where it is, unless it is opened wider than there is of it to see.
    seen = torch.minimum(at.height, mine).clamp_min(0)
    eye = seen * (1 - their / mine.clamp_min(LEAST)).clamp_min(0)
    # A rim as sharp as a step would have steps, pixel by pixel.
    above = ((at.height - mine) / RIM + 0.5).clamp(0, 1)
    return eye + above * (lid - eye)


def shut_shares(points: Tensor, at: Tensor, eyes: Tensor, own: Tensor) -> Tensor:
    """How much of what is seen of points is to be read off a view of shut eyes, (K,) in 0..1.

    Skin that unfolds as a lid shuts is shown by no open eye: the lid passes to such a view early,
    the eye under it, which that view does not show, when hardly anything of it is left.

    Args:
        points: (M, 3).
        at: (K,) which of them to treat, see `near`.
        eyes: (2, 7).
        own: (M or 1, 2) measures of the lids in the frame of each point.
    """
    opened = openings(eyes, own if len(own) == 1 else own[at])
    place = _placed(points[at], eyes)
    opening = opened.expand(len(at), 2).gather(1, place.side[:, None])[:, 0]
    shut = 1 - opening / eyes[place.side, 6].clamp_min(LEAST)
    passed = torch.where(
        place.height > opening * place.bulge,
        brows.ramp(shut, *LID_PASSES),
        brows.ramp(shut, *EYE_PASSES),
    )
    # Where the motion ends, what open eyes show goes over into what shut ones do.
    beside = brows.ramp(place.across.abs(), 1 + SOFT, 1) * brows.ramp(place.height, -BELOW, 0)
    return passed * beside * brows.ramp(place.height / place.top.clamp_min(LEAST), 1, 1 - SOFT)


def shut_frame(eyes: Tensor, measures: Tensor, forward: Tensor) -> int | None:
    """The frame whose eyes are both shut, the most usual pose of such; None where there is none.

    Args:
        eyes: (2, 7).
        measures: (T, 2) of the lids.
        forward: (T, 3) where the head looks.
    """
    rest = eyes[:, 6]
    shut = (openings(eyes, measures) < SHUT_SHARE * rest).all(1).nonzero().squeeze(1)
    if not len(shut):
        return None
    usual = (forward[shut] - forward.median(0).values).norm(dim=1)
    return int(shut[usual.argmin()])


def shut(codes: Tensor, first: int) -> Tensor:
    """What is told of frames (F, told_dim) as if their eyes were shut; `first` as in `untold`."""
    codes = codes.clone()
    codes[:, first:][:, MEASURES] = -1 / LENGTH
    return codes


def untold(codes: Tensor, first: int) -> Tensor:
    """What is told of frames (F, told_dim) as if their lids were at rest.

    Where points are moved with the lids, there is nothing left to tell: a field that is told of a
    blink as well makes up colours for it, from the few frames that show one.

    Args:
        first: where the measures of the upper face begin.
    """
    rest = torch.ones(codes.shape[1], dtype=codes.dtype, device=codes.device)
    rest[first:][MEASURES] = 0
    return codes * rest


def near(points: Tensor, eyes: Tensor) -> Tensor:
    """Which of the points (M, 3) lids (2, 7) may move, (K,): one in twenty of a head's."""
    x, y, z = points.unbind(-1)
    lowest = (eyes[:, [1, 3]].amin(1) - eyes[:, 4]).amin() - BELOW
    highest = (eyes[:, [1, 3]].amax(1) + eyes[:, 5]).amax() + BESIDE
    high = (y > lowest) & (y < highest)
    beside = SOFT / 2 * (eyes[:, 2] - eyes[:, 0])
    wide = (x > eyes[0, 0] - beside[0]) & (x < eyes[1, 2] + beside[1])
    return (high & wide & (z > brows.EAR)).nonzero().squeeze(1)


def add_lifts(
    lift: Tensor, points: Tensor, at: Tensor, eyes: Tensor, own: Tensor, theirs: Tensor
) -> None:
    """Adds the motion of the lids to that of the brows, in place.

    Args:
        lift: (N, M) by the brows.
        points: (M, 3).
        at: (K,) which points to treat, see `near`.
        eyes: (2, 7).
        own: (M or 1, 2), theirs: (N, 2), as in `lifts`.
    """
    skin = brows.lowered(points[at].expand(len(lift), -1, -1), lift[:, at])
    lift[:, at] += lifts(skin, eyes, own if len(own) == 1 else own[at], theirs)


def mirrored(eyes: Tensor) -> Tensor:
    """The eyes (2, 7) of a mirrored person."""
    return eyes.flip(0)[:, [2, 3, 0, 1, 4, 5, 6]] * eyes.new_tensor([-1, 1, -1, 1, 1, 1, 1])
