"""The skin's detail in every frame, in a file that is sampled many times.

Detail is the grey values without the shading. Light does not move when a head turns, so shading
moves differently from the skin and would bias the poses.

T frames, N points. Small windows that move with the face: memory stays constant, and a frame is
decoded once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dubbing.preparation.crops.threads import in_order

BLUR = 1.2  # px at a crop of 512
SHADING = 2.8  # px at a crop of 512: the blur that is left is shading
DETAIL_GAIN = 4.0  # of detail, around the grey value 128
MARGIN = 16.0  # px at a crop of 512, around the points


@dataclass(frozen=True)
class FaceStrip:
    """images (T, h, w) uint8 and the position (T, 2) of their first pixels (x, y) in the crop."""

    images: np.ndarray
    corner: np.ndarray

    @staticmethod
    def record(path: Path, crops: np.ndarray, pixels: np.ndarray) -> FaceStrip:
        """Cut the strip out of crops (T, S, S, 3), around the face's pixels (T, P, 2) of each.

        Args:
            path: file that holds the images for as long as they are needed.
        """
        size = crops.shape[1]
        margin = MARGIN * size / 512
        low, high = pixels.min(1) - margin, pixels.max(1) + margin
        width, height = np.minimum(np.ceil((high - low).max(0)).astype(int) + 1, size)
        corner = np.clip(low.round().astype(int), 0, size - np.array([width, height]))
        shape = len(crops), int(height), int(width)
        strip = np.lib.format.open_memmap(path, mode="w+", dtype=np.uint8, shape=shape)

        def cut(t: int) -> None:
            grey = cv2.cvtColor(crops[t], cv2.COLOR_RGB2GRAY).astype(np.float32)
            fine, coarse = (cv2.GaussianBlur(grey, (0, 0), b * size / 512) for b in (BLUR, SHADING))
            detail = np.clip(128 + DETAIL_GAIN * (fine - coarse), 0, 255).round()
            x, y = corner[t]
            strip[t] = detail[y : y + height, x : x + width]

        for _ in in_order(cut, ((t,) for t in range(len(crops)))):
            pass
        return FaceStrip(strip, corner)

    def take(self, index: np.ndarray) -> FaceStrip:
        """Some of the frames."""
        return FaceStrip(self.images[index], self.corner[index])

    def sample(self, frames: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Grey values (K, N) float32 at pixels (K, N, 2) of some crops (K,); NaN outside."""
        values = self._read(frames, pixels, self.images[frames][..., None].astype(np.float32))
        return values[..., 0]

    def slopes(self, frames: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Derivatives (K, N, 2) of the grey values along columns and rows, in levels a px."""
        images = self.images[frames].astype(np.float32)
        slopes = np.zeros((*images.shape, 2), np.float32)
        slopes[:, :, 1:-1, 0] = (images[:, :, 2:] - images[:, :, :-2]) / 2
        slopes[:, 1:-1, :, 1] = (images[:, 2:] - images[:, :-2]) / 2
        return self._read(frames, pixels, slopes)

    def _read(self, frames: np.ndarray, pixels: np.ndarray, levels: np.ndarray) -> np.ndarray:
        """Images (K, h, w, C) float32 at pixels (K, N, 2) of the crops, bilinear: (K, N, C)."""
        # OpenCV rounds positions to 1/32 px, so the four neighbours are interpolated here.
        at = pixels - self.corner[frames, None].astype(np.float32)
        first = np.floor(at)
        column, row = first[..., 0], first[..., 1]
        count, height, width = levels.shape[:3]
        inside = (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1)
        flat = np.where(inside, row * width + column, 0).astype(np.intp)
        flat += np.arange(count)[:, None] * (height * width)
        u, v = (at - first)[..., :1], (at - first)[..., 1:]
        values = levels.reshape(-1, levels.shape[3])
        left, right = values.take(flat, 0), values.take(flat + 1, 0)
        upper = left + (right - left) * u
        left, right = values.take(flat + width, 0), values.take(flat + width + 1, 0)
        read = upper + (left + (right - left) * u - upper) * v
        read[~inside] = np.nan
        return np.asarray(read)
