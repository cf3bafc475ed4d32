"""Detects faces, and palms of hands: BlazeFace for short range, and the palm detector of its kind.

Bazarevsky et al. 2019, "BlazeFace: Sub-millisecond Neural Face Detection on Mobile GPUs"; Zhang et
al. 2020, "On-device Real-time Hand Tracking" (arXiv 2006.10214): boxes relative to fixed anchors;
boxes that overlap are averaged, weighted by their scores.

Letters: A anchors.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.face.finding.graph_network import GraphNetwork
from dubbing.face.finding.regions import Images, Region

SAME = 0.3  # intersection over union


@dataclass(frozen=True)
class Layout:
    """How a network says what it detects.

    Attributes:
        size: px, side of its input. low: value of black there; that of white is 1.
        layers: cells a side, and anchors a cell.
        ends: the two points of a box, by number, that tell how it is turned.
    """

    size: int
    low: float
    layers: tuple[tuple[int, int], ...]
    ends: tuple[int, int]

    def anchors(self) -> np.ndarray:
        """Middles (A, 2) of the anchors in shares of the input."""
        cells = []
        for side, count in self.layers:
            row, column = np.mgrid[:side, :side].reshape(2, -1)
            cells.append(np.repeat((np.stack((column, row), 1) + 0.5) / side, count, 0))
        return np.concatenate(cells)


FACES = Layout(128, -1.0, ((16, 2), (8, 6)), (0, 1))  # its eyes
PALMS = Layout(192, 0.0, ((24, 2), (12, 6)), (0, 2))  # wrist, and root of the middle finger


class BoxDetector:
    """Finds boxes in images (H, W, 3) uint8 RGB.

    Args:
        confidence: a box's least score, 0..1.
    """

    def __init__(self, network: GraphNetwork, layout: Layout, confidence: float) -> None:
        self._network, self._layout, self._confidence = network, layout, confidence
        self._anchors = layout.anchors()

    def __call__(self, images: Images, count: int) -> list[list[np.ndarray]]:
        """At most `count` boxes of each image, the likeliest first.

        Returns:
            Of each its upper left and lower right corner and its two ends, (4, 2) px.
        """
        if not len(images):
            return []
        size = self._layout.size
        squares = [_whole(image) for image in images]
        pairs = zip(squares, images, strict=True)
        inputs = np.stack([s.cut(image, size, cv2.BORDER_CONSTANT) for s, image in pairs])
        found = self._network(inputs, low=self._layout.low)
        boxes, logits = (values.astype(np.float64) for values in found)
        scores = 1 / (1 + np.exp(-logits[..., 0].clip(-100, 100)))
        return [
            [self._placed(square, value) for value in self._likely(box, score)[:count]]
            for square, box, score in zip(squares, boxes, scores, strict=True)
        ]

    def _likely(self, boxes: np.ndarray, scores: np.ndarray) -> list[np.ndarray]:
        """Middle, size and ends (8,) of the boxes of an image, in shares of the input."""
        likely = scores >= self._confidence
        columns = [(0, 1), (2, 3), *((4 + 2 * end, 5 + 2 * end) for end in self._layout.ends)]
        values = boxes[likely][:, np.ravel(columns)] / self._layout.size
        values[:, [0, 1, 4, 5, 6, 7]] += np.tile(self._anchors[likely], 3)
        return merge(values, scores[likely])

    @staticmethod
    def _placed(square: Region, values: np.ndarray) -> np.ndarray:
        middle, half = values[:2], values[2:4] / 2
        return square.place(np.stack((middle - half, middle + half, values[4:6], values[6:])))


def _whole(image: np.ndarray) -> Region:
    """The square round a whole image."""
    height, width = image.shape[:2]
    return Region(width / 2, height / 2, max(height, width))


def merge(values: np.ndarray, scores: np.ndarray) -> list[np.ndarray]:
    """Averages of boxes (B, 8) with scores (B,) that overlap.

    Returns:
        Middle, size and ends of each, the highest score first.
    """
    order = np.argsort(-scores, kind="stable")
    values, scores = values[order], scores[order]
    low, high = values[:, :2] - values[:, 2:4] / 2, values[:, :2] + values[:, 2:4] / 2
    areas = values[:, 2] * values[:, 3]
    left = np.arange(len(values))
    boxes = []
    while len(left):
        first = left[0]
        sides = np.minimum(high[left], high[first]) - np.maximum(low[left], low[first])
        common = sides.clip(0).prod(1)
        same = common > SAME * (areas[left] + areas[first] - common)
        same[0] = True
        chosen = left[same]
        boxes.append(np.average(values[chosen], 0, scores[chosen]))
        left = left[~same]
    return boxes
