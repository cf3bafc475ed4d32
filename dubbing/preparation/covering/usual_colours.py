"""Usual colours of each place of a face and its surroundings, in the frame of the face.

The frame of the face is upright, W x H pixels, with the outer corners of the eyes `EYES` apart.
Colours are luma and the two chromas of BT.601 (Y, Cr, Cb), each 0..255, in the shot's usual light.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.preparation.covering.light import shade

EYES = 56.0  # px
W, H = 176, 160
EYES_AT = 8.0  # px below the upper edge
# px by which speech and turns move a place: colours of this neighbourhood are usual, too.
ACROSS, DOWN = 5, 12
SPREADS = 3.0  # deviations from the median that are usual
LEAST_SPREAD, MOST_SPREAD = 4.0, 15.0  # levels; occlusions often increase the spread of a place
MARGIN = np.array([12.0, 8.0, 8.0])  # levels beyond most colours of skin
STILL, UNCHANGED = 10.0, 25.0  # levels: spread of a static place, and distance from its median
SHADOW = 0.5  # of the darkest skin: places that mostly show skin are not darker
DARK = 8.0  # levels added before a logarithm: noise of dark colours counts less
SHADE = 8.0  # px, Gaussian: light varies more slowly
INSIDE = 0.03  # eye distances from the outline of the face


@dataclass(frozen=True)
class UsualColours:
    """Bounds of usual colours, median and spread of each place (H, W, 3); bounds of skin (3,)."""

    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    spread: np.ndarray
    skin_low: np.ndarray
    skin_high: np.ndarray

    @staticmethod
    def of(faces: Iterable[np.ndarray], skin: np.ndarray, lips: np.ndarray) -> UsualColours:
        """Usual colours from some frames.

        Args:
            faces: (H, W, 3) in the frame of the face, as of `upright`.
            skin: (N, 3) colours of the upper face. lips: (M, 3), most of them of lips.
        """
        stack = np.stack(list(faces))
        middle = np.median(stack, 0)
        spread = 1.4826 * np.median(np.abs(stack - middle), 0)
        reach = SPREADS * np.clip(spread, LEAST_SPREAD, MOST_SPREAD)
        near = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * ACROSS + 1, 2 * DOWN + 1))
        least, most = np.percentile(skin, [1, 99], axis=0)
        less, more = np.percentile(lips, [25, 75], axis=0)
        low, high = cv2.erode(middle - reach, near), cv2.dilate(middle + reach, near)
        least, most = np.minimum(least, less) - MARGIN, np.maximum(most, more) + MARGIN
        return UsualColours(low, high, middle, spread, least, most)

    def beyond(self, face: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Distance of colours (H, W, 3) in the frame of the face from usual ones, levels (H, W).

        Args:
            inside: (H, W) bool, well within the outline of the face. Usual colours there must also
                be those of skin or its shadows, so that a permanent overlay is not usual.
        """
        skin = inside & (self.from_skin(self.middle) == 0)
        least = np.where(skin[..., None], self.skin_low * (SHADOW, 1, 1), self.low)
        least[..., 1:] = np.where(inside[..., None], self.skin_low[1:], self.low[..., 1:])
        low = np.maximum(self.low, least)
        high = np.where(inside[..., None], np.minimum(self.high, self.skin_high), self.high)
        away = np.maximum(np.maximum(face - high, low - face), 0)
        return np.asarray(np.maximum(away[..., 0], 2 * away[..., 1:].max(-1)))

    def evenly_lit(self, face: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Colours (H, W, 3) in the frame of the face without the shadows that fall on it.

        Args:
            known: (H, W) bool, where usual colours are to be expected.
        """
        own, usual = (rgb_of(colours) for colours in (face, self.middle))
        ratio = np.log(np.maximum(own, 0) + DARK) - np.log(np.maximum(usual, 0) + DARK)
        own *= np.exp(-shade(ratio, known, SHADE))
        return np.asarray(cv2.cvtColor(own / 255, cv2.COLOR_RGB2YCrCb) * 255)

    def from_skin(self, colours: np.ndarray) -> np.ndarray:
        """Distance of colours (..., 3) from those of skin, levels (...)."""
        away = np.maximum(np.maximum(colours - self.skin_high, self.skin_low - colours), 0)
        return np.asarray(np.linalg.norm(away, axis=-1))

    def settled(self, face: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Pixels (H, W) bool outside the face that look as always: collar, wall, shirt."""
        still = self.spread.max(-1) < STILL
        return ~inside & still & (np.abs(face - self.middle).max(-1) < UNCHANGED)


def to_face(
    points: np.ndarray, eyes: float = EYES, width: int = W, below: float = EYES_AT
) -> np.ndarray:
    """The similarity (2, 3) float32 from px of a crop to a frame of the face.

    Args:
        eyes: distance between the outer corners of the eyes there, px.
        width: of that frame, px. below: how far the eyes are below its upper edge, px.
    """
    left, right = (points[k, :2].astype(np.float64) for k in (LEFT_EYE_OUTER, RIGHT_EYE_OUTER))
    across = right - left
    length = max(float(np.hypot(*across)), 1.0)
    cosine, sine = across / length
    turn = eyes / length * np.array([[cosine, sine], [-sine, cosine]])
    move = np.array([width / 2, below]) - turn @ ((left + right) / 2)
    return np.concatenate([turn, move[:, None]], 1).astype(np.float32)


def upright(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A crop (S, S, 3) uint8 in the frame of the face."""
    flags, border = cv2.INTER_AREA, cv2.BORDER_REPLICATE
    return np.asarray(
        cv2.warpAffine(image, to_face(points), (W, H), flags=flags, borderMode=border)
    )


def in_usual_light(image: np.ndarray, gain: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """RGB (..., 3) of a frame whose light is known, as Y, Cr, Cb float32 in the usual light."""
    unlit = np.clip((image - offset) / gain, 0, 255).astype(np.float32)
    shape = unlit.shape
    flat = unlit.reshape(1, -1, 3) / 255
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2YCrCb).reshape(shape) * 255)


def rgb_of(colours: np.ndarray) -> np.ndarray:
    """Colours (H, W, 3) Y, Cr, Cb as RGB, 0..255, float32."""
    scaled = (colours / 255).astype(np.float32)
    return np.asarray(cv2.cvtColor(scaled, cv2.COLOR_YCrCb2RGB) * 255)


def inside_face(points: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool of the frame of the face well within its outline.

    Args:
        points: (P, 2) px of that frame.
    """
    face = np.zeros((H, W), np.uint8)
    cv2.fillPoly(face, [points[list(FACE_OVAL)].round().astype(np.int32)], 1)
    reach = round(INSIDE * EYES)
    return cv2.erode(face, np.ones((2 * reach + 1, 2 * reach + 1))) > 0


def eye_distance(points: np.ndarray) -> float:
    """Distance between the outer corners of the eyes, px."""
    return float(np.hypot(*(points[RIGHT_EYE_OUTER, :2] - points[LEFT_EYE_OUTER, :2])))
