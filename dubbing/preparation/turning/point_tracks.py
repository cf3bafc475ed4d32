"""Corners on a head that are followed from frame to frame (Lucas and Kanade 1981).

F frames in a row, O observations of P points, S side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.turning.head_surface import HeadSurface

POINTS = 400  # in a frame, at most
SPACING = 0.014  # of the crop's side, between points
QUALITY = 0.002
WINDOW, LEVELS = 0.045, 3  # of the crop's side; levels of the pyramid
RETURNS = 0.6  # px: a point followed back must come to where it was
PERSON = 128  # of 255
EDGE = 7  # px, of the person mask: its outline does not move with the head
SHORTEST = 5  # frames in which a point is seen


@dataclass(frozen=True)
class PointTracks:
    """Points that were followed.

    Attributes:
        point, frame: (O,) numbers of each observation. pixels: (O, 2).
        places: (P, 3) head frame, where the points seemed to be when they were first seen.
    """

    point: np.ndarray
    frame: np.ndarray
    pixels: np.ndarray
    places: np.ndarray

    def lasting(self) -> PointTracks:
        """Those of points that are seen for a while."""
        long = np.bincount(self.point, minlength=len(self.places)) >= SHORTEST
        kept, number = long[self.point], np.cumsum(long) - 1
        return PointTracks(
            number[self.point[kept]], self.frame[kept], self.pixels[kept], self.places[long]
        )


@dataclass
class _Followed:
    """Points that are being followed: their numbers (P,) and pixels (P, 2)."""

    number: np.ndarray
    pixels: np.ndarray

    def only(self, keep: np.ndarray) -> _Followed:
        return _Followed(self.number[keep], self.pixels[keep])


def follow(
    crops: Iterator[np.ndarray],
    people: Iterator[np.ndarray],
    poses: Poses,
    centre: np.ndarray,
    surface: HeadSurface,
) -> PointTracks:
    """Tracks of points on the head through frames in a row.

    Args:
        crops: (S, S, 3) uint8 of each frame. people: person masks (S, S) uint8.
        poses: (F), rough ones: they say which pixels are firm on the skull.
        centre: (F, 2) principal points.
    """
    here = _Followed(np.zeros(0, int), np.zeros((0, 2)))
    before: np.ndarray | None = None
    places, observed = [np.zeros((0, 3))], []
    count = 0
    for k, (crop, person) in enumerate(zip(crops, people, strict=True)):
        grey = np.asarray(cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY))
        pose = poses.rotation[k], poses.translation[k], centre[k]
        inside = cv2.erode((person > PERSON).astype(np.uint8), np.ones((EDGE, EDGE)))
        if before is not None and len(here.pixels):
            here = _moved(before, grey, here)
            at = here.pixels.round().astype(int).clip(0, len(grey) - 1)
            here = here.only(inside[at[:, 1], at[:, 0]] > 0)
            here = here.only(surface.lifted(here.pixels, *pose)[1])
        before = grey
        new = _corners(grey, inside, here.pixels)
        lifted, firm = surface.lifted(new, *pose)
        new, lifted = new[firm], lifted[firm]
        number = np.arange(count, count + len(new))
        count += len(new)
        places.append(lifted)
        here = _Followed(np.concatenate([here.number, number]), np.concatenate([here.pixels, new]))
        observed.append((here.number, np.full(len(here.number), k), here.pixels))
    point, frame, pixels = (np.concatenate(parts) for parts in zip(*observed, strict=True))
    return PointTracks(point, frame, pixels, np.concatenate(places)).lasting()


def _moved(before: np.ndarray, after: np.ndarray, points: _Followed) -> _Followed:
    """Points where they are in the next picture; those that do not come back are left out."""
    window = max(9, round(WINDOW * len(after)) | 1)
    size, start = (window, window), points.pixels.astype(np.float32)
    there, good, _ = cv2.calcOpticalFlowPyrLK(
        before, after, start, np.zeros_like(start), winSize=size, maxLevel=LEVELS
    )
    back, _, _ = cv2.calcOpticalFlowPyrLK(
        after, before, there, np.zeros_like(start), winSize=size, maxLevel=LEVELS
    )
    kept = (good[:, 0] > 0) & (np.linalg.norm(back - start, axis=1) < RETURNS)
    return _Followed(points.number, np.asarray(there, np.float64)).only(kept)


def _corners(grey: np.ndarray, inside: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """New corners (P, 2) px inside of a mask, apart from those that are taken."""
    free = inside * np.uint8(255)
    apart = max(3.0, SPACING * len(grey))
    for x, y in taken.round().astype(int).tolist():
        cv2.circle(free, (x, y), int(apart), 0, -1)
    wanted = POINTS - len(taken)
    if wanted <= 0:
        return np.zeros((0, 2))
    found = cv2.goodFeaturesToTrack(grey, wanted, QUALITY, apart, mask=free)
    return np.zeros((0, 2)) if found is None else np.asarray(found[:, 0], np.float64)
