"""The neck below a jaw that moves: the film's own neck, stretched or pushed to the new chin.

Where the film's jaw is lower than the rendered one, the image has no neck between them. Skin,
shadow and folds exist below the film's chin, only too low; where it is higher, its shadow would be
covered. So each column of the image is scaled, from the collar up. Lengths are in px, given for
S = 512 and scaled. S is the side of the crop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, grey_opening, median_filter, minimum_filter1d

from dubbing.compositing.face_mask import jaw_share
from dubbing.face.face_contour import FaceContour
from dubbing.preparation.background.pixels import around, extent
from dubbing.preparation.matting.matting import REFERENCE_SIZE

SMOOTH = 1.5  # px, standard deviation: along the outlines
BELOW = 4.0  # px from the outline of the film's jaw to where none of it shows
MAX_NECK_PX = 40.0  # of neck that are stretched
# How much lower a neck's share of red may be than the face's, if it is brighter, or if it is not: a
# shirt lights the shade above it. A collar's is lower.
SKIN, SHADED = 0.05, 0.08
# Shares of the face's light: below the first is shadow, whose colour says nothing, below the other
# the gap under a collar.
DARK, GAP = 0.45, 0.25
TOO_FEW, ENOUGH = 8.0, 20.0  # px of neck below the chin to stretch
EDGE = 3.0  # px of neck that the edge of a collar shades
NARROW = 10.0  # px: fewer columns beside one another are no neck
SIDE = 4.0  # px from the front of a turned neck that its edge, or a collar's, shades
PUSHED = 0.25  # of a neck's length: shorter it is not drawn, and in full from twice as much on
EVEN = 12.0  # px, standard deviation: along a collar
UNDER = 12.0  # px that the neck extends under the edge of the head


@dataclass(frozen=True)
class Neck:
    """Neck and clothes below the film's jaw in each column of a frame.

    Attributes:
        low: (S,) row below which none of the jaw shows. room: (S,) px of neck below it.
        share: (S,) share of the jaw that has enough neck to be stretched.
        clothes: (S,) share of each column in which it touches clothes, or what else is no neck.
    """

    low: np.ndarray
    room: np.ndarray
    share: np.ndarray
    clothes: np.ndarray

    @classmethod
    def of(cls, image: np.ndarray, matte: np.ndarray, contour: FaceContour) -> Neck:
        """That of a frame (S, S, 3) uint8 and its head (S, S) uint8."""
        size = len(image)
        unit = size / REFERENCE_SIZE
        low = smooth(bottom(matte), unit) + BELOW * unit
        x, y = np.arange(size) - contour.middle[0], low - contour.middle[1]
        jaw = jaw_share(contour, np.arctan2(y, x))
        wide = max(2, round(NARROW * unit))
        # In a collar's shade some columns seem to be neck, and those beside them not.
        room = median_filter(room_below(image, low, jaw > 0), 2 * wide + 1)
        enough = np.clip((room / unit - TOO_FEW) / (ENOUGH - TOO_FEW), 0, 1)
        clothes = grey_opening((jaw > 0) * (1 - enough), wide)
        return cls(low, room, jaw * enough, gaussian_filter1d(clothes, EVEN * unit))


def with_neck(
    image: np.ndarray,
    background: np.ndarray,
    neck: Neck,
    opacity: np.ndarray,
    turned: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """A background whose neck begins at the rendered chin, and the pixels that it changed.

    A column keeps its background where a collar begins too close below a chin, the film's or the
    rendered one, and where there is no head.

    Args:
        image: (S, S, 3) uint8 frame of the film. background: the same with its head removed.
        neck: of the image. opacity: (S, S) uint8 of the rendered head.
        turned: 0..1, how far the edge of the neck may be that of its front, before a wall.

    Returns:
        (S, S, 3) uint8 and (S, S) bool.
    """
    size = len(image)
    unit = size / REFERENCE_SIZE
    column, low, room = np.arange(size), neck.low, neck.room
    high = smooth(bottom(opacity), unit)
    left = (low + room - high) / np.maximum(room, unit)
    share = neck.share * np.clip(left / PUSHED - 1, 0, 1) * (high > 0)
    share = grey_opening(share, max(2, round(NARROW * unit)))
    inner = minimum_filter1d(share, 2 * round(SIDE * unit) + 1)
    share += turned * (gaussian_filter1d(inner, SIDE / 2 * unit) - share)
    if not share.any():
        return background, np.zeros((size, size), bool)
    end, top = low + room, high - UNDER * unit
    columns = slice(*np.flatnonzero(share)[[0, -1]] + [0, 1])
    some = share > 0
    rows = slice(max(0, int(top[some].min())), min(size, int(end[some].max()) + 1))
    row = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None]
    source = end - (end - row) * room / np.maximum(end - high, unit)
    stretched = cv2.remap(
        image,
        np.broadcast_to(column.astype(np.float32), source.shape)[:, columns],
        np.maximum(source, low).astype(np.float32)[:, columns],
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    weight = (share * ((row < end) & (row > top)))[:, columns]
    below = background[rows, columns]
    out, changed = background.copy(), np.zeros((size, size), bool)
    blended = below + weight[..., None] * (stretched.astype(np.float32) - below)
    out[rows, columns], changed[rows, columns] = blended.round(), weight > 0
    return out, changed


def bottom(head: np.ndarray) -> np.ndarray:
    """Row where each column leaves a head (S, S) uint8 for good, (S,); 0 where there is none."""
    inside = np.pad(head, ((0, 1), (0, 0)), mode="edge").astype(np.float32)
    last = len(head) - 1 - (inside[-2::-1] >= 127.5).argmax(0)
    column = np.arange(len(last))
    before, after = inside[last, column], inside[last + 1, column]
    part = np.clip((before - 127.5) / np.maximum(before - after, 1), 0, 1)
    return np.where(before >= 127.5, np.minimum(last + part, len(head) - 1), 0)


def room_below(image: np.ndarray, low: np.ndarray, jaw: np.ndarray) -> np.ndarray:
    """Px of neck (S,), at most `MAX_NECK_PX`, that each column has below the chin (S,).

    Pixels at least about as red as the face are neck, and dark ones with such below them. The face
    is measured above the chin, in the columns `jaw` (S,) bool.
    """
    size, out = len(image), np.zeros(len(image))
    unit = size / REFERENCE_SIZE
    if not jaw.any():
        return out
    _, columns = extent(jaw[None])
    low, jaw = low[columns], jaw[columns]
    reach = math.ceil((MAX_NECK_PX + EDGE) * unit) + 2
    top, end = int(low[jaw].min()) - reach, int(low[jaw].max()) + reach
    rows = slice(max(0, top), min(size, end))
    wide, own = around((rows, columns), 1, size)
    smoothed = cv2.blur(image[wide], (3, 3))[own].astype(np.float32) + 1
    light = smoothed.sum(2)
    red = smoothed[..., 0] / light
    row = np.arange(size)[rows, None]
    face = (row < low - 3 * BELOW * unit) & (row > low - MAX_NECK_PX * unit) & jaw
    if not face.any():
        return out
    # A lamp from the side leaves columns dark, the neck as the face above it.
    lit, usual = face.any(0), np.full(len(low), np.median(light[face]))
    own = np.ma.median(np.ma.array(light, mask=~face), 0)[lit].filled(0)
    usual[lit] = np.minimum(usual[lit], gaussian_filter1d(own, EVEN * unit, mode="nearest"))
    pale = np.where(light < usual, SHADED, SKIN)
    dark, gap, below = light < DARK * usual, light < GAP * usual, row >= low
    unlike = red < np.median(red[face]) - pale
    gap &= ~_enclosed(below & ~dark & ~unlike)
    other = below & (gap | (~dark & unlike))
    first = np.where(other.any(0), other.argmax(0), len(row))
    # A shadow with neck below it is neck.
    neck = below & ~dark & (row - rows.start < first)
    last = len(row) - neck[::-1].argmax(0)
    collar = np.where(last == len(row), size, rows.start + last - EDGE * unit)
    collar = np.where(neck.any(0), collar, 0)
    out[columns] = np.clip(collar - low, 0, MAX_NECK_PX * unit)
    return out


def _enclosed(skin: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool with skin to the left, to the right and below: at most its shadow."""
    beside = np.logical_or.accumulate(skin, 1) & np.logical_or.accumulate(skin[:, ::-1], 1)[:, ::-1]
    return np.asarray(beside & np.logical_or.accumulate(skin[::-1])[::-1])


def smooth(rows: np.ndarray, unit: float) -> np.ndarray:
    """Rows (S,) smoothed along the columns that have one."""
    weight = gaussian_filter1d((rows > 0).astype(float), SMOOTH * unit)
    return np.where(rows > 0, gaussian_filter1d(rows, SMOOTH * unit) / np.maximum(weight, 1e-6), 0)
