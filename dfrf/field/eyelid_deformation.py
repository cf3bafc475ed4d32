"""Lids close as skin does, and a closed eye is the person's own.

Fifteen seconds show two or three blinks, and references hardly ever one. A field that knows only
how far the lids are open has to paint a closed eye from those few frames. One that knows where the
skin of the lid came from need not. The skin that unfolds as a lid closes, which open eyes do not
show, is read off a frame of a blink, kept beside the references.

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
from jaxtyping import Float, Int
from torch import Tensor

from dfrf.field import brow_deformation

MEASURES = slice(0, 2)  # of the upper face: the left and the right lid, in LENGTH
LENGTH = 0.1  # of the distance between the outer corners of the eyes: a blink is about -1
RIM = 0.012  # head units from lid to eye: a pixel or two
WHITE = 0.012  # head units: the eye's white is seen so far below the points of the lower lid
# Head units: as far open FaceMesh finds an eye that is closed, from the same line.
CLOSED = 0.02 * brow_deformation.EYE_DISTANCE + WHITE
WIDEST = 1.5  # times the opening at rest: what is measured beyond is taken for this
SHORTEST = 1e-3  # head units, no length is divided by less
# From how far to how far closed a lid, and the eye under it, pass to a view of closed eyes.
LID_PASSES, EYE_PASSES = (0.3, 0.6), (0.5, 0.8)
SOFT = 0.3  # of half the lid's width, beside it, and of its height: one view goes over into others
BELOW = 0.05  # head units below the lower rim that skin moves in a blink
CLOSED_SHARE = 0.15  # of the opening at rest: an eye that is less open is closed
BESIDE = 0.1  # head units above the motion's end that brows may have lifted its skin


def openings(eyes: Float[Tensor, "2 7"], measures: Float[Tensor, "*B 2"]) -> Float[Tensor, "*B 2"]:
    """How far apart the rims of the lids are in the middle, head units.

    Args:
        eyes: see above.
        measures: of the left and of the right lid.
    """
    rest = eyes[:, 6]
    measured = rest + measures * (LENGTH * brow_deformation.EYE_DISTANCE)
    # Eyes that are hardly open at rest do not flutter with every error of the measure.
    way = torch.maximum(rest - CLOSED, rest / 3).clamp_min(SHORTEST)
    share = (measured - CLOSED) / way
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
    u = (2 * x - left - right) / (right - left).clamp_min(SHORTEST)
    bulge = (1 - u * u).clamp_min(0) * brow_deformation.ramp(
        z, brow_deformation.EAR, brow_deformation.FRONT
    )
    line = (left_height + right_height) / 2 + u * (right_height - left_height) / 2
    return _Place(side, u, bulge, y - (line - lower * bulge), end + lower * bulge)


def lifts(
    points: Float[Tensor, "#N M 3"],
    eyes: Float[Tensor, "2 7"],
    own: Float[Tensor, "#M 2"],
    theirs: Float[Tensor, "N 2"],
) -> Float[Tensor, "N M"]:
    """How much further up skin is than where each reference shows it, head units.

    Args:
        points: with their brows where each reference has them.
        eyes: see above.
        own: measures of the lids in the frame of each point.
        theirs: measures in the references.
    """
    at, own = _placed(points, eyes), openings(eyes, own)
    mine = own.expand(points.shape[1], 2).gather(1, at.side[0, :, None])[:, 0] * at.bulge
    their = openings(eyes, theirs)[:, at.side[0]] * at.bulge
    # From the rim to the end of the motion, the skin of the lid comes to rest.
    way = (at.top - mine).clamp_min(SHORTEST)
    lid = (1 - ((at.height - mine) / way).clamp(0, 1)) * (mine - their)
    # An eye stays where it is, unless it is opened wider than there is of it to see.
    visible = torch.minimum(at.height, mine).clamp_min(0)
    eye = visible * (1 - their / mine.clamp_min(SHORTEST)).clamp_min(0)
    # A rim as sharp as a step would have steps, pixel by pixel.
    above = ((at.height - mine) / RIM + 0.5).clamp(0, 1)
    return eye + above * (lid - eye)


def closed_eye_weights(
    points: Float[Tensor, "M 3"],
    at: Int[Tensor, " K"],
    eyes: Float[Tensor, "2 7"],
    own: Float[Tensor, "#M 2"],
) -> Float[Tensor, " K"]:
    """How much of what is seen of points is to be read off a view of closed eyes, 0..1.

    Skin that unfolds as a lid closes is shown by no open eye: the lid passes to such a view early,
    the eye under it, which that view does not show, when hardly anything of it is left.

    Args:
        points: head frame.
        at: which of them to treat, see `points_near_eyes`.
        eyes: see above.
        own: measures of the lids in the frame of each point.
    """
    opened = openings(eyes, own if len(own) == 1 else own[at])
    place = _placed(points[at], eyes)
    opening = opened.expand(len(at), 2).gather(1, place.side[:, None])[:, 0]
    closed = 1 - opening / eyes[place.side, 6].clamp_min(SHORTEST)
    passed = torch.where(
        place.height > opening * place.bulge,
        brow_deformation.ramp(closed, *LID_PASSES),
        brow_deformation.ramp(closed, *EYE_PASSES),
    )
    # Where the motion ends, what open eyes show goes over into what closed ones do.
    beside = brow_deformation.ramp(place.across.abs(), 1 + SOFT, 1) * brow_deformation.ramp(
        place.height, -BELOW, 0
    )
    return (
        passed
        * beside
        * brow_deformation.ramp(place.height / place.top.clamp_min(SHORTEST), 1, 1 - SOFT)
    )


def closed_eye_frame(
    eyes: Float[Tensor, "2 7"], measures: Float[Tensor, "T 2"], forward: Float[Tensor, "T 3"]
) -> int | None:
    """The frame whose eyes are both closed, nearest to the median pose; None where there is none.

    Args:
        eyes: see above.
        measures: of the lids.
        forward: where the head looks.
    """
    rest = eyes[:, 6]
    closed = (openings(eyes, measures) < CLOSED_SHARE * rest).all(1).nonzero().squeeze(1)
    if not len(closed):
        return None
    turned = (forward[closed] - forward.median(0).values).norm(dim=1)
    return int(closed[turned.argmin()])


def with_closed_eyes(conditioning: Float[Tensor, "F K"], first: int) -> Float[Tensor, "F K"]:
    """Conditioning as if the eyes were closed; `first` as in `with_eyelids_at_rest`."""
    conditioning = conditioning.clone()
    conditioning[:, first:][:, MEASURES] = -1 / LENGTH
    return conditioning


def with_eyelids_at_rest(conditioning: Float[Tensor, "F K"], first: int) -> Float[Tensor, "F K"]:
    """Conditioning as if the lids were at rest.

    Where points are moved with the lids, nothing is left to be conditioned on: a field that knows
    of a blink as well makes up colours for it, from the few frames that show one.

    Args:
        first: where the measures of the upper face begin.
    """
    rest = conditioning.new_ones(conditioning.shape[1])
    rest[first:][MEASURES] = 0
    return conditioning * rest


def points_near_eyes(points: Float[Tensor, "M 3"], eyes: Float[Tensor, "2 7"]) -> Int[Tensor, " K"]:
    """Which of the points lids may move: one in twenty of a head's."""
    x, y, z = points.unbind(-1)
    lowest = (eyes[:, [1, 3]].amin(1) - eyes[:, 4]).amin() - BELOW
    highest = (eyes[:, [1, 3]].amax(1) + eyes[:, 5]).amax() + BESIDE
    high = (y > lowest) & (y < highest)
    beside = SOFT / 2 * (eyes[:, 2] - eyes[:, 0])
    wide = (x > eyes[0, 0] - beside[0]) & (x < eyes[1, 2] + beside[1])
    return (high & wide & (z > brow_deformation.EAR)).nonzero().squeeze(1)


def add_lifts(
    lift: Float[Tensor, "N M"],
    points: Float[Tensor, "M 3"],
    at: Int[Tensor, " K"],
    eyes: Float[Tensor, "2 7"],
    own: Float[Tensor, "#M 2"],
    theirs: Float[Tensor, "N 2"],
) -> None:
    """Adds the motion of the lids to that of the brows, in place.

    Args:
        lift: by the brows.
        points: head frame.
        at: which points to treat, see `points_near_eyes`.
        eyes: see above.
        own, theirs: as in `lifts`.
    """
    skin = brow_deformation.lowered(points[at].expand(len(lift), -1, -1), lift[:, at])
    lift[:, at] += lifts(skin, eyes, own if len(own) == 1 else own[at], theirs)


def mirrored(eyes: Float[Tensor, "2 7"]) -> Float[Tensor, "2 7"]:
    """The eyes of a mirrored person."""
    return eyes.flip(0)[:, [2, 3, 0, 1, 4, 5, 6]] * eyes.new_tensor([-1, 1, -1, 1, 1, 1, 1])
