"""Finds hands in images, and follows them from frame to frame.

Zhang et al. 2020, "On-device Real-time Hand Tracking" (arXiv 2006.10214): palms are detected, and
the points of a hand are found in the region round it; they give the region for the next frame.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from dubbing.face.finding.box_detector import PALMS, BoxDetector
from dubbing.face.finding.face_finder import distinct
from dubbing.face.finding.graph_network import network
from dubbing.face.finding.regions import Region
from dubbing.face.weight_paths import HAND_DETECTOR, HAND_LANDMARKS

POINTS = 21
SIZE = 224  # px, side of the network's input
WRIST = 0
KNUCKLES = (5, 9, 13)  # where the three middle fingers begin
PALM_AND_ROOTS = (0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18)  # what of a hand gives its next region
HANDS = 2  # at most
PALM, CONFIDENCE = 0.5, 0.5  # least score of a palm, least probability of a hand
# Side of a region in sides of what it is made from, and how far it is moved towards the fingers.
AROUND_PALM, AROUND_HAND = (2.6, 0.5), (2.0, 0.1)


class HandFinder:
    """Points (21, 3) of hands: column, row and depth in px of the image."""

    def __init__(self) -> None:
        self._detector = BoxDetector(network(HAND_DETECTOR), PALMS, PALM)
        self._network = network(HAND_LANDMARKS)

    def follow(self, images: Iterable[np.ndarray]) -> list[list[np.ndarray]]:
        """Hands of the frames (H, W, 3) uint8 RGB of a video, `HANDS` a frame at most."""
        found: list[list[np.ndarray]] = []
        for image in images:
            followed = [region_of(points) for points in found[-1]] if found else []
            (palms,) = self._detector([image], HANDS)
            regions = distinct([*map(palm_region, palms), *followed])
            found.append([p for p in (self._hand(image, r) for r in regions) if p is not None])
        return [hands[-HANDS:] for hands in found]

    def _hand(self, image: np.ndarray, region: Region) -> np.ndarray | None:
        pixels = region.cut(image, SIZE, cv2.BORDER_CONSTANT)[None]
        points, there, *_ = self._network(pixels)
        if there.item() < CONFIDENCE:
            return None
        return region.place(points.reshape(POINTS, 3).astype(float) / SIZE)


def palm_region(palm: np.ndarray) -> Region:
    """The region in which the hand of a palm is looked for; see `BoxDetector`."""
    low, high, wrist, fingers = palm
    return _region((low + high) / 2, float((high - low).max()), _turn(wrist, fingers), AROUND_PALM)


def region_of(points: np.ndarray) -> Region:
    """The region in which a hand with these points (21, 3) is looked for in the next frame."""
    flat = points[:, :2]
    turn = _turn(flat[WRIST], flat[list(KNUCKLES)].mean(0))
    turned = flat[list(PALM_AND_ROOTS)] @ _axes(turn)
    low, high = turned.min(0), turned.max(0)
    return _region(_axes(turn) @ (low + high) / 2, float((high - low).max()), turn, AROUND_HAND)


def _region(middle: np.ndarray, side: float, turn: float, around: tuple[float, float]) -> Region:
    scale, shift = around
    column, row = middle - shift * side * _axes(turn)[:, 1]
    return Region(float(column), float(row), scale * side, turn)


def _turn(wrist: np.ndarray, fingers: np.ndarray) -> float:
    """Rotation, in radians, of a region in which the fingers point upwards from the wrist."""
    right, down = fingers - wrist
    return float(np.arctan2(right, -down))


def _axes(turn: float) -> np.ndarray:
    """Directions (2, 2) of a region's columns and rows in the image, one a column."""
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
