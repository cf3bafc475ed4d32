"""The colour of a film's lips beside those of the learned head: lipstick.

Where film and head show the same face with the same lips, what the light leaves of the ratio of
their colours is the lips' own. It is a logarithm for red, green and blue, (3,); `SAME` changes
nothing. Lips are 40 points, those of the outer edge and then those of the inner one.
"""

from collections.abc import Sequence

import cv2
import numpy as np

SAME = np.zeros(3)
LEAST = 10.0  # px of lips, with the outer corners of the eyes `comparison.EYES` apart
BLUR = 0.8  # px, Gaussian: of a picture that was made small
FINE = 4  # px beside one another in a px, of which those on lips are counted
FEWEST = 3  # frames
# Of a logarithm, between channels; lips of the clip that was learned from differ by .04 at most.
NOTICED = 0.15
SOFT = 0.003  # of the crop's side, Gaussian: the edge of lips


def measured(apart: np.ndarray, lips: np.ndarray) -> np.ndarray:
    """The colour of lips in a frame, (3,); NaN where few are seen.

    In a small picture most pixels of lips show skin, too. So the colour is that which explains all
    of them by their shares of lips best, by least squares.

    Args:
        apart: (H, W, 3) logarithm of the film's colours over the head's, without the light.
        lips: (40, 2) px, of both.
    """
    share = cv2.GaussianBlur(share_of_lips(lips, apart.shape[:2]), (0, 0), BLUR)
    square = float((share**2).sum())
    if square < LEAST:
        return np.full(3, np.nan)
    return np.asarray((share[..., None] * apart).sum((0, 1)) / square)


def share_of_lips(lips: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The share of each pixel that lips (40, 2) px cover, (H, W) float32."""
    fine: np.ndarray = np.zeros((FINE * shape[0], FINE * shape[1]), np.uint8)
    outer, inner = np.split((FINE * lips + (FINE - 1) / 2).round().astype(np.int32), 2)
    cv2.fillPoly(fine, [outer, inner], 255)  # what is in both is between the lips
    whole = cv2.resize(fine, shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(whole / np.float32(255))


def lip_colour(found: Sequence[np.ndarray]) -> np.ndarray:
    """The colour of lips of a shot, (3,), of those of frames: that of most, if it is noticed.

    What changes all channels alike, or from frame to frame, is light that was not followed.
    """
    known = [one for one in found if np.isfinite(one).all()]
    if len(known) < FEWEST:
        return SAME
    less, usual, more = np.percentile(known, (16, 50, 84), axis=0)
    noticed = max(NOTICED, float((more - less).max()))
    return usual if np.ptp(usual) >= noticed else SAME


def with_lip_colour(head: np.ndarray, lips: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """A head (S, S, 4) uint8, premultiplied by opacity, with lips of that colour.

    Args:
        head: the same. lips: (40, 2) px, where it shows them. colour: (3,).
    """
    if not colour.any():
        return head
    share = share_of_lips(lips, head.shape[:2])
    share = cv2.GaussianBlur(share, (0, 0), SOFT * len(head))
    out = head.copy()
    tinted = head[..., :3] * np.exp(share[..., None] * colour.astype(np.float32))
    out[..., :3] = np.minimum(tinted.round(), head[..., 3:])
    return out
