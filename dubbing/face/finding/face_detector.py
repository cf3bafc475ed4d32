"""Detects faces: BlazeFace for short range.

Bazarevsky et al. 2019, "BlazeFace: Sub-millisecond Neural Face Detection on Mobile GPUs": boxes
relative to fixed anchors; boxes that overlap are averaged, weighted by their scores.

Letters: N images, A = 896 anchors.
"""

from __future__ import annotations

import cv2
import numpy as np

from dubbing.face.finding.graph_network import GraphNetwork
from dubbing.face.finding.regions import Images, Region

SIZE = 128  # px, side of the network's input
LAYERS = ((16, 2), (8, 6))  # cells a side, and anchors a cell
SAME_FACE = 0.3  # intersection over union
EYES = slice(4, 8)  # of a box's 16 values; before them its middle and its size


def _anchors() -> np.ndarray:
    """Middles (A, 2) of the anchors in shares of the input."""
    cells = []
    for side, count in LAYERS:
        row, column = np.mgrid[:side, :side].reshape(2, -1)
        cells.append(np.repeat((np.stack((column, row), 1) + 0.5) / side, count, 0))
    return np.concatenate(cells)


ANCHORS = _anchors()


class FaceDetector:
    """Finds the regions of faces in images (H, W, 3) uint8 RGB.

    Args:
        network: of `face_detector.safetensors`.
        confidence: a face's least score, 0..1.
    """

    def __init__(self, network: GraphNetwork, confidence: float) -> None:
        self._network, self._confidence = network, confidence

    def __call__(self, images: Images, faces: int) -> list[list[Region]]:
        """At most `faces` regions of each image, the likeliest face first."""
        if not len(images):
            return []
        squares = [_whole(image) for image in images]
        pairs = zip(squares, images, strict=True)
        inputs = np.stack([s.cut(image, SIZE, cv2.BORDER_CONSTANT) for s, image in pairs])
        boxes, logits = (values.astype(np.float64) for values in self._network(inputs, low=-1))
        scores = 1 / (1 + np.exp(-logits[..., 0].clip(-100, 100)))
        found = []
        for square, box, score in zip(squares, boxes, scores, strict=True):
            likely = score >= self._confidence
            values = box[likely] / SIZE
            values[:, [0, 1]] += ANCHORS[likely]
            values[:, EYES] += np.tile(ANCHORS[likely], 2)
            merged = merge(values[:, :8], score[likely])[:faces]
            found.append([_region(square, value) for value in merged])
        return found


def _whole(image: np.ndarray) -> Region:
    """The square round a whole image."""
    height, width = image.shape[:2]
    return Region(width / 2, height / 2, max(height, width))


def _region(square: Region, values: np.ndarray) -> Region:
    """Region of a face, from its box and eyes in shares of the input."""
    middle, half = values[:2], values[2:4] / 2
    places = square.place(np.stack((middle - half, middle + half, values[4:6], values[6:8])))
    return Region.around(places[0], places[1], places[2:])


def merge(values: np.ndarray, scores: np.ndarray) -> list[np.ndarray]:
    """Faces (8,) from boxes (B, 8) with scores (B,): overlapping boxes are averaged.

    Returns:
        Middle, size and eyes of each face, the highest score first.
    """
    order = np.argsort(-scores, kind="stable")
    values, scores = values[order], scores[order]
    low, high = values[:, :2] - values[:, 2:4] / 2, values[:, :2] + values[:, 2:4] / 2
    areas = values[:, 2] * values[:, 3]
    left = np.arange(len(values))
    faces = []
    while len(left):
        first = left[0]
        sides = np.minimum(high[left], high[first]) - np.maximum(low[left], low[first])
        common = sides.clip(0).prod(1)
        same = common > SAME_FACE * (areas[left] + areas[first] - common)
        same[0] = True
        chosen = left[same]
        faces.append(np.average(values[chosen], 0, scores[chosen]))
        left = left[~same]
    return faces
