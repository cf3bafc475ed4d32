"""Edges of a film, and those of them that stand still while things move.

T frames, S side of a crop in px; n frames are looked at, H x W px each.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

BLUR = 0.7  # px, Gaussian: noise has edges, too
STRONG = 6.0  # levels a px: what an edge is
CHROMA = 2.0  # weight of the red chroma, by which skin differs from a grey of its brightness
STEADY = 0.3  # of an edge: it changes less in all frames


@dataclass(frozen=True)
class Film:
    """The crops of a film.

    Attributes:
        crops: (T, S, S, 3) RGB. points: (T, P, 2 or more) px. window: (T, 4), see `cropping`.
        scale: of what is looked at, to a crop.
    """

    crops: np.ndarray
    points: np.ndarray
    window: np.ndarray
    scale: float

    def move(self, t: int, of: int) -> np.ndarray:
        """By how much a place in the window of one frame lies further in that of another, px."""
        apart = self.window[t, :2] - self.window[of, :2]
        return np.asarray(apart * self.crops.shape[1] / self.window[t, 2])

    def look(self, t: int, of: int) -> np.ndarray:
        """Frame t (H, W, 3) in the window of another."""
        image = moved(self.crops[t], self.move(t, of))
        return cv2.resize(image, (self.side, self.side), interpolation=cv2.INTER_AREA)

    def glance(self, t: int, of: int, part: tuple[slice, slice]) -> np.ndarray:
        """About the part (h, w, 3) of such a frame."""
        rows, columns = (
            slice(round(one.start / self.scale), round(one.stop / self.scale)) for one in part
        )
        image = moved(self.crops[t], self.move(t, of))[rows, columns]
        size = part[1].stop - part[1].start, part[0].stop - part[0].start
        return cv2.resize(image, size, interpolation=cv2.INTER_AREA)

    def at(self, t: int, of: int) -> np.ndarray:
        """Its points (P, 2)."""
        size = self.crops.shape[1]
        return np.asarray((self.points[t][:, :2] + self.move(t, of)) * (self.side / size))

    @property
    def side(self) -> int:
        """H and W of what is looked at."""
        return max(1, round(self.scale * self.crops.shape[1]))


def moved(image: np.ndarray, by: np.ndarray) -> np.ndarray:
    """An image (S, S, ...), moved by (2,) px."""
    if not by.any():
        return np.asarray(image)
    shift = np.array([[1, 0, by[0]], [0, 1, by[1]]])
    return cv2.warpAffine(image, shift, image.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)


def edges_of(image: np.ndarray) -> np.ndarray:
    """Change of luma and red chroma across and down, levels a px, (H, W, 2, 2)."""
    smooth = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2YCrCb), (0, 0), BLUR)
    parts = [
        [weight * cv2.Scharr(smooth[..., k].astype(np.float32), cv2.CV_32F, *axis) / 32]
        for k, weight in ((0, 1.0), (1, CHROMA))
        for axis in ((1, 0), (0, 1))
    ]
    return np.moveaxis(np.reshape(parts, (2, 2, *image.shape[:2])), (0, 1), (2, 3))


def standing(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (H, W, 2, 2) of edges (n, H, W, 2, 2), mean distance from it, which of them stand still.

    Both (H, W).
    """
    mean = edges.mean(0)
    change = np.linalg.norm((edges - mean).reshape(*edges.shape[:3], 4), axis=-1).mean(0)
    strength = np.linalg.norm(mean, axis=(2, 3))
    return mean, change, (strength > STRONG) & (change < STEADY * strength)
