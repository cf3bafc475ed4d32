"""Person masks by the network of SelfieSegmentation, for several images and threads."""

from __future__ import annotations

import cv2
import numpy as np

from dubbing.face.finding.graph_network import network
from dubbing.face.finding.regions import Images
from dubbing.face.weight_paths import PERSON_MASK

INPUT_SIDE = 256  # px, side of the network's input
BATCH = 4  # images at once: more do not fit a core's cache


def person_masks(images: Images) -> list[np.ndarray]:
    """Probabilities (S, S) float32 in 0..1 that pixels of RGB images belong to a person."""
    found: list[np.ndarray] = []
    for start in range(0, len(images), BATCH):
        part = images[start : start + BATCH]
        side = (INPUT_SIDE, INPUT_SIDE)
        small = np.stack([cv2.resize(k, side, interpolation=cv2.INTER_AREA) for k in part])
        (masks,) = network(PERSON_MASK)(small)
        for image, mask in zip(part, masks[:, 0], strict=True):
            found.append(cv2.resize(mask, image.shape[1::-1], interpolation=cv2.INTER_LINEAR))
    return found
