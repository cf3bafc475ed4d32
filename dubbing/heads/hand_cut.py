"""Cuts hands out that lie over a face. They have its colours: their points say where they are.

A hand is capsules round its fingers and its palm, and a wedge for its forearm. Between what is
surely of it and what surely is not, `cv2.grabCut` finds the edge. S side of a crop in px.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from dubbing.face.finding.hand_finder import WRIST, HandFinder
from dubbing.heads.comparison import EYES, Compared, H, W, images, to_face
from dubbing.heads.cover_cut import APART, ROUNDS, on_edges
from dubbing.identity.clip_frames import ClipFrames
from dubbing.preparation.matting.matting import dilate

FINGERS = ((1, 2, 3, 4), (5, 6, 7, 8), (9, 10, 11, 12), (13, 14, 15, 16), (17, 18, 19, 20))
PALM = (0, 1, 2, 5, 9, 13, 17)
ROOTS = (5, 9, 13, 17)
MIDDLE = 9  # where the middle finger begins
FOREARM = 6.0  # its length, in palms
FINEST = 48  # px, length of a palm from which a picture is made smaller
FRACTION = 16  # of a pixel, as OpenCV draws
BELOW = 12  # px of the frame of the face round the lower face, where a chin may be new
DIFFERS = 0.25  # of a hand over it that the head does not explain
EVERY = 5  # frames from one that is searched for hands before anything is learned to the next
WRIST_AWAY = 0.1  # eye distances from the face to the wrist of a hand before it, at least
OVER = 0.05  # of the frame of the face: less of a hand is beside the lower face
LEFT = 0.5  # of the frames, at least, must show no hand, or all are taken


@dataclass(frozen=True)
class Thickness:
    """Radius of fingers, palm and wrist, and of the forearm's end, in palms.

    And how far tips go beyond their points, in lengths of the last bone.
    """

    finger: float
    palm: float
    wrist: float
    arm: float
    tip: float


SURE = Thickness(0.05, 0.05, 0.12, 0.0, 0.0)  # of a hand in any case
LIKELY = Thickness(0.12, 0.14, 0.3, 0.0, 0.2)
WIDEST = Thickness(0.2, 0.24, 0.42, 1.6, 0.7)


def palm_length(hand: np.ndarray) -> float:
    """From the wrist to where the fingers begin, of points (21, 3) px, in px."""
    return float(np.linalg.norm(hand[list(ROOTS)] - hand[WRIST], axis=1).mean())


def drawn(hand: np.ndarray, size: tuple[int, int], thick: Thickness) -> np.ndarray:
    """Pixels (height, width) bool of a hand with points (21, 3) px, so thick."""
    mask, unit, flat = np.zeros(size, np.uint8), palm_length(hand), hand[:, :2]

    def line(start: np.ndarray, end: np.ndarray, radius: float) -> None:
        first, last = ((FRACTION * p).round().astype(int).tolist() for p in (start, end))
        cv2.line(mask, first, last, 1, max(1, round(2 * radius * unit)), cv2.LINE_8, 4)

    for finger in FINGERS:
        for start, end in pairwise(finger):
            line(flat[start], flat[end], thick.finger)
        last, tip = flat[list(finger[-2:])]
        line(tip, tip + thick.tip * (tip - last), thick.finger)
    cv2.fillPoly(mask, [flat[list(PALM)].round().astype(np.int32)], 1)
    for start, end in zip(PALM, (*PALM[1:], WRIST), strict=True):
        line(flat[start], flat[end], thick.palm)
    along = flat[WRIST] - flat[MIDDLE]
    along = along / max(float(np.linalg.norm(along)), 1e-6)
    across = np.array([-along[1], along[0]]) * unit
    end = flat[WRIST] + FOREARM * unit * along
    wedge = [flat[WRIST] + across * thick.wrist, flat[WRIST] - across * thick.wrist]
    wedge += [end - across * thick.arm, end + across * thick.arm]
    if thick.arm:
        cv2.fillPoly(mask, [np.round(wedge).astype(np.int32)], 1)
    return mask > 0


def in_face(hand: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool in the frame of the face that a hand, points (21, 3) px, likely covers.

    Args:
        landmarks: (478, 2) px of the face.
    """
    turn = to_face(landmarks)
    placed = hand.copy()
    placed[:, :2] = hand[:, :2] @ turn[:, :2].T + turn[:, 2]
    placed[:, 2] *= np.hypot(*turn[0, :2])
    return drawn(placed, (H, W), LIKELY)


def lies_over(hand: np.ndarray, compared: Compared, landmarks: np.ndarray) -> bool:
    """Whether a hand with points (21, 3) px lies over the lower face, or touches it.

    What the head explains there is no hand. Nor is one whose wrist lies on the face, or next to
    it: a mouth that is wide open looks like a fist.

    Args:
        landmarks: (478, 2) px of the face.
    """
    outline = cv2.convexHull(landmarks.astype(np.float32))
    inside = cv2.pointPolygonTest(outline, hand[WRIST, :2].astype(float).tolist(), True)
    if inside * np.hypot(*to_face(landmarks)[0, :2]) > -WRIST_AWAY * EYES:
        return False
    there = in_face(hand, landmarks)
    seen = there & compared.known
    if seen.any():
        return bool((compared.apart[seen] > APART / 2).mean() > DIFFERS)
    return bool((there & dilate(compared.known | compared.lips, BELOW)).any())


def without_hands(footage: ClipFrames) -> ClipFrames:
    """Frames of a clip, of which those with a hand before the mouth count as without a face.

    A finger in a picture of a mouth would be seen wherever that mouth is. Of `EVERY` frames one is
    searched; those around it are like it.
    """
    clip, finder = footage.clip, HandFinder()
    some = footage.with_face[::EVERY]
    seen = [
        t
        for t, image in zip(some, images(clip, some), strict=True)
        if any(in_face(hand, clip.landmarks[t]).mean() > OVER for hand in finder.follow([image])[0])
    ]
    near = np.abs(np.subtract.outer(np.arange(len(clip)), np.array(seen, int))) < EVERY
    left = replace(footage, clip=replace(clip, detected=clip.detected & ~near.any(1)))
    return left if len(left.with_face) >= LEFT * len(footage.with_face) else footage


def hand_mask(image: np.ndarray, hands: Sequence[np.ndarray]) -> np.ndarray:
    """Mask (S, S) uint8 of hands, points (21, 3) px, with the edges of the picture (S, S, 3)."""
    mask = np.zeros(image.shape[:2], np.uint8)
    for hand in hands:
        np.maximum(mask, _one(image, hand), out=mask)
    return mask


def _one(image: np.ndarray, hand: np.ndarray) -> np.ndarray:
    size = len(image)
    scale = min(1.0, FINEST / max(palm_length(hand), 1.0))
    side = max(1, round(size * scale))
    small = cv2.resize(image, (side, side), interpolation=cv2.INTER_AREA)
    points = hand * side / size
    cut = np.full((side, side), cv2.GC_BGD, np.uint8)
    cut[drawn(points, (side, side), WIDEST)] = cv2.GC_PR_BGD
    cut[drawn(points, (side, side), LIKELY)] = cv2.GC_PR_FGD
    cut[drawn(points, (side, side), SURE)] = cv2.GC_FGD
    if not (cut == cv2.GC_FGD).any() or not (cut == cv2.GC_BGD).any():
        return np.zeros((size, size), np.uint8)
    cv2.setRNGSeed(0)
    behind, over = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(small, cut, (0, 0, side, side), behind, over, ROUNDS, cv2.GC_INIT_WITH_MASK)
    found = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.float32)
    wide = cv2.resize(found, (size, size), interpolation=cv2.INTER_LINEAR)
    return on_edges(wide, image, 1 / scale)
