"""Squares of an image, turned, that networks look at.

Pixels are counted from the edge of the first one, as the published graphs do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

Images = Sequence[np.ndarray] | np.ndarray  # each (H, W, 3) uint8 RGB
STEPS = 32  # of a rounded place in a side, of a side until it is twice as large, and in a radian
MARGIN = 1.5  # side of a region in sides of the box that it is made from
# Degrees. Up to the first a face's box has the image's sides, as in the published graphs; from the
# second on its own: a box with the image's is too large for it, and chins are found too high.
TILTED = (20.0, 30.0)


@dataclass(frozen=True)
class Region:
    """A square: middle (column, row) and side in px, and rotation in radians."""

    column: float
    row: float
    side: float
    rotation: float = 0.0

    @classmethod
    def around(cls, points: np.ndarray, eyes: np.ndarray) -> Region:
        """The region round points (N, 2), turned as the line between two points `eyes` (2, 2)."""
        turn = tilt(eyes)
        sides = np.interp(abs(turn), np.radians(TILTED), (0, abs(turn))) * np.sign(turn)
        axes = np.array([[np.cos(sides), -np.sin(sides)], [np.sin(sides), np.cos(sides)]])
        placed = points @ axes
        low, high = placed.min(0), placed.max(0)
        column, row = axes @ (low + high) / 2
        return cls(float(column), float(row), MARGIN * float((high - low).max()), turn)

    def rounded(self) -> Region:
        """A region near it, the same for almost all that differ by a small part of a pixel."""
        side = 2.0 ** (round(STEPS * math.log2(max(self.side, 1))) / STEPS)
        column, row = (round(STEPS * at / side) * side / STEPS for at in (self.column, self.row))
        return Region(column, row, side, round(STEPS * self.rotation) / STEPS)

    @property
    def matrix(self) -> np.ndarray:
        """Map (2, 3) to px of the image from shares of the region, 0 at its upper left corner."""
        cosine, sine = np.cos(self.rotation) * self.side, np.sin(self.rotation) * self.side
        axes = np.array([[cosine, -sine], [sine, cosine]])
        corner = np.array([self.column, self.row]) - axes.sum(1) / 2
        return np.column_stack((axes, corner))

    def cut(self, image: np.ndarray, size: int, border: int) -> np.ndarray:
        """The region's pixels (size, size, 3) uint8; `border` is one of OpenCV's."""
        matrix = np.vstack((self.matrix / [size, size, 1], [0, 0, 1]))
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        image = np.ascontiguousarray(image)
        return cv2.warpPerspective(image, matrix, (size, size), flags=flags, borderMode=border)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 2 or 3) in shares of the region, in px of the image; depth in px too."""
        matrix = self.matrix
        flat = points[..., :2] @ matrix[:, :2].T + matrix[:, 2]
        return np.concatenate((flat, points[..., 2:] * self.side), -1)


def tilt(eyes: np.ndarray) -> float:
    """How far the line between the left and the right eye (2, 2) is turned clockwise, radians."""
    right, down = eyes[1] - eyes[0]
    return float(np.arctan2(down, right))


def overlap(first: Region, second: Region) -> float:
    """Intersection over union of two regions, as if they were not turned."""
    half = (first.side + second.side) / 2
    most = min(first.side, second.side)
    width = min(half - abs(first.column - second.column), most)
    height = min(half - abs(first.row - second.row), most)
    if width <= 0 or height <= 0:
        return 0.0
    common = width * height
    return common / (first.side**2 + second.side**2 - common)
