"""The crops of a clip's frames, with the results of tracking.

T frames, S the side of the crop in px. Every step of a preparation reads the crops again, and
decoding and scaling them costs more than reading. So they lie in a file, 3 bytes a pixel, for as
long as the preparation takes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.media import MediaInfo

CROPS, PERSON, OPACITY, ALPHA = "crops.npy", "person.npy", "opacity.npy", "alpha.npy"


def create_images(path: Path, *shape: int) -> np.ndarray:
    """A new file of images (T, S, S) or (T, S, S, 3) uint8, mapped for writing."""
    return np.lib.format.open_memmap(path, mode="w+", dtype=np.uint8, shape=shape)


def open_images(path: Path) -> np.ndarray:
    """The images in a file of :func:`create_images`, mapped for reading."""
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


@dataclass(frozen=True)
class TrackedCrops:
    """Crops of a tracked clip, from which matte and background are made.

    crops (T, S, S, 3), person masks and opacities of persons (T, S, S), all uint8 and mapped;
    window (T, 4), landmarks (T, 478, 2) and jaw outline (T, K, 2) px of the crop, valid (T,)
    bool: the head's position is known, segment (T,) int. gain and offset (T, 3): colours of a
    frame are gain * usual + offset; 1 and 0 in the usual light.
    """

    info: MediaInfo
    crops: np.ndarray
    person: np.ndarray
    opacity: np.ndarray
    window: np.ndarray
    landmarks: np.ndarray
    outline: np.ndarray
    valid: np.ndarray
    segment: np.ndarray
    gain: np.ndarray
    offset: np.ndarray

    def __len__(self) -> int:
        return len(self.crops)

    @property
    def size(self) -> int:
        """S, side of the crop in px."""
        return self.crops.shape[1]

    def well_lit(self) -> np.ndarray:
        """Frames (T,) bool whose light differs little from the usual light."""
        usual = np.abs(np.log(self.gain)).max(1) < math.log(2)
        return np.asarray(usual & (self.offset == 0).all(1))

    def unlit(self, frames: np.ndarray) -> np.ndarray:
        """Crops (K, S, S, 3) uint8 of frames (K,), relit to the usual light."""
        out = self.crops[frames]
        for k in np.flatnonzero((self.gain[frames] != 1).any(1)):
            t = frames[k]
            out[k] = np.clip((out[k] - self.offset[t]) / self.gain[t], 0, 255).round()
        return out

    def lit(self, image: np.ndarray, t: int) -> np.ndarray:
        """An image (H, W, 3) of the usual light, relit to the light of frame t."""
        if (self.gain[t] == 1).all() and not self.offset[t].any():
            return image
        lit = image * self.gain[t] + self.offset[t]
        return np.asarray(np.clip(lit, 0, 255), np.float32).astype(image.dtype)

    def offsets(self) -> np.ndarray:
        """Position (T, 2) of the window's first pixel on its shot's canvas, whole px (x, y)."""
        out = np.zeros((len(self), 2), int)
        for shot in np.unique(self.segment):
            index = self.segment == shot
            corner = self.window[index, :2]
            scale = self.size / self.window[0, 2]
            out[index] = ((corner - corner.min(0)) * scale).round()
        return out
