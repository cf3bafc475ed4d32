"""The frames of a clip as its crops, with what tracking found in them.

T frames, S the side of the crop in px. Every stage of a preparation looks at the crops again, and
decoding and scaling them costs more than reading: they lie in a file, 3 bytes a pixel, for as long
as the preparation takes.
"""

from __future__ import annotations

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
    bool: the head's place is known, segment (T,) int.
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

    def __len__(self) -> int:
        return len(self.crops)

    @property
    def size(self) -> int:
        """S."""
        return self.crops.shape[1]

    def offsets(self) -> np.ndarray:
        """Place (T, 2) of the window's first pixel on the canvas of its shot, whole px (x, y)."""
        out = np.zeros((len(self), 2), int)
        for shot in np.unique(self.segment):
            index = self.segment == shot
            corner = self.window[index, :2]
            scale = self.size / self.window[0, 2]
            out[index] = ((corner - corner.min(0)) * scale).round()
        return out
