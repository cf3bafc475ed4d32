"""Person masks by MediaPipe's SelfieSegmentation, for several threads."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

import cv2
import numpy as np

from dubbing.face.mediapipe_graph import Solution, solution

INPUT_SIDE = 256  # px, side of the network's input


class PersonMasks(ExitStack):
    """A pool of networks, one a thread. Leaving the context closes them.

    MediaPipe keeps a network's memory, some 25 MB, until it is closed.
    """

    def __init__(self) -> None:
        super().__init__()
        self._idle: list[Solution] = []

    def mask(self, image: np.ndarray) -> np.ndarray:
        """Probability (S, S) float32 in 0..1 that a pixel of an RGB image belongs to a person."""
        try:
            network = self._idle.pop()
        except IndexError:
            network = self._another()
        small = cv2.resize(image, (INPUT_SIDE, INPUT_SIDE), interpolation=cv2.INTER_AREA)
        mask = network.process(small).segmentation_mask
        self._idle.append(network)
        return cv2.resize(mask, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)

    def _another(self) -> Solution:
        networks = solution("selfie_segmentation")
        network = Solution(partial(networks.SelfieSegmentation, model_selection=0))
        self.callback(network.close)
        return network
