"""Which pixels belong to a person: MediaPipe's SelfieSegmentation, for several threads."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

import cv2
import numpy as np

from dubbing.face.mediapipe_graph import Solution, solution

LOOKED_AT = 256  # px, side of what the network takes


class PersonMasks(ExitStack):
    """As many networks as threads look at once. Leaving the context closes them.

    MediaPipe keeps what a network took, some 25 MB, until it is closed.
    """

    def __init__(self) -> None:
        super().__init__()
        self._idle: list[Solution] = []

    def __call__(self, image: np.ndarray) -> np.ndarray:
        """Probability (S, S) float32 in 0..1 that a pixel of an RGB image belongs to a person."""
        try:
            network = self._idle.pop()
        except IndexError:
            network = self._another()
        small = cv2.resize(image, (LOOKED_AT, LOOKED_AT), interpolation=cv2.INTER_AREA)
        mask = network.process(small).segmentation_mask
        self._idle.append(network)
        return cv2.resize(mask, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)

    def _another(self) -> Solution:
        networks = solution("selfie_segmentation")
        network = Solution(partial(networks.SelfieSegmentation, model_selection=0))
        self.callback(network.close)
        return network
