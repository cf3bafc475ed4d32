"""The frames of a clip as its crops, with what tracking found in them.

T frames, S the side of the crop in px. Every stage of a preparation looks at the crops again, and
decoding and scaling them costs more than reading: they lie in a file, 3 bytes a pixel, for as long
as the preparation takes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dubbing.media import MediaInfo

CROPS, PERSON, OPACITY = "crops.npy", "person.npy", "opacity.npy"


def new_pictures(path: Path, *shape: int) -> np.ndarray:
    """Pictures (T, S, S) or (T, S, S, 3) uint8 in a file, to be written into."""
    return np.lib.format.open_memmap(path, mode="w+", dtype=np.uint8, shape=shape)


def pictures(path: Path) -> np.ndarray:
    """What was written into :func:`new_pictures`, mapped: read where it is looked at."""
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


@dataclass(frozen=True)
class Footage:
    """A clip on its way to matte and background.

    crops (T, S, S, 3), person masks and opacities of persons (T, S, S), all uint8 and mapped;
    window (T, 3), landmarks (T, 478, 2) and jaw outline (T, K, 2) px of the crop, valid (T,)
    bool: the head's place is known, segment (T,) int. gain and offset (T, 3): colours of a frame
    are gain * usual + offset; 1 and 0 where the light is the usual one.
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
        """S."""
        return self.crops.shape[1]

    def well_lit(self) -> np.ndarray:
        """Frames (T,) bool in which light differs little from the usual one."""
        usual = np.abs(np.log(self.gain)).max(1) < math.log(2)
        return np.asarray(usual & (self.offset == 0).all(1))

    def unlit(self, frames: np.ndarray) -> np.ndarray:
        """Crops (K, S, S, 3) uint8 of frames (K,) as they would look in the usual light."""
        out = self.crops[frames]
        for k in np.flatnonzero((self.gain[frames] != 1).any(1)):
            t = frames[k]
            out[k] = np.clip((out[k] - self.offset[t]) / self.gain[t], 0, 255).round()
        return out

    def lit(self, picture: np.ndarray, t: int) -> np.ndarray:
        """A picture (H, W, 3) in the usual light as it would look in frame t."""
        if (self.gain[t] == 1).all() and not self.offset[t].any():
            return picture
        lit = picture * self.gain[t] + self.offset[t]
        return np.asarray(np.clip(lit, 0, 255), np.float32).astype(picture.dtype)

    def offsets(self) -> np.ndarray:
        """Place (T, 2) of the window's first pixel on the canvas of its shot, whole px (x, y)."""
        out = np.zeros((len(self), 2), int)
        for shot in np.unique(self.segment):
            index = self.segment == shot
            corner = self.window[index, :2]
            scale = self.size / self.window[0, 2]
            out[index] = ((corner - corner.min(0)) * scale).round()
        return out
