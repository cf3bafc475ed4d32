"""A frame of a prepared clip, with all that belongs to it. S is the side of the crop in px."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class FilmFrame:
    """A frame of a prepared clip.

    Attributes:
        image: (S, S, 3) crop. matte: (S, S) of the head. fill: (S, S, 3), what is behind it. All
            uint8.
        overlay: (S, S) uint8, 255 where something lies over the face; None where nothing does.
        haze: (3,) grey levels of light over the image; see `covering.light`.
        noise: (5,) of the film, see `film_noise`. motion: (2,) px that the head moves in a frame.
        landmarks: (478, 2) px of the crop.
        jaw: (K,) px, see `compositing.jaw_line.beside`. grade: (3,), see `compositing.grade`. None
            where the head was not compared.
        whole: (H, W, 3) uint8, the source frame that the crop is of.
    """

    image: np.ndarray
    matte: np.ndarray
    fill: np.ndarray
    overlay: np.ndarray | None
    haze: np.ndarray
    noise: np.ndarray
    motion: np.ndarray
    landmarks: np.ndarray
    whole: np.ndarray
    jaw: np.ndarray | None = None
    grade: np.ndarray | None = None

    @cached_property
    def restored(self) -> np.ndarray:
        """Where the background is restored, (S, S) bool: the matte's inpaint mask."""
        from dubbing.preparation.matting.matting import inpaint_mask

        return inpaint_mask(self.matte)

    @cached_property
    def background(self) -> np.ndarray:
        """The frame without the head, (S, S, 3) uint8: the image where nothing is restored."""
        import cv2

        return cv2.copyTo(self.fill, self.restored.astype(np.uint8), self.image.copy())
