"""Grey values of frames at the points of the skin.

K frames, N points. Single precision: a pixel's place is exact to 1e-4 px, a grey value to 1e-5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.alignment.face_strip import FaceStrip
from dubbing.preparation.alignment.skin import Skin
from dubbing.preparation.crops.threads import in_order

LEAST_FACING = 0.3  # cosine between normal and ray, below which a point is not used
CHUNK = 8  # frames a thread treats at a time


@dataclass(frozen=True)
class View:
    """The skin from the view of the camera in some frames.

    turns (K, 3, 3), of row vectors: from the head's axes to the camera's. points, normals
    (K, N, 3): turned, but not moved; in_camera (K, N, 3); pixels (K, N, 2); visible (K, N)
    bool: facing the camera.
    """

    turns: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    in_camera: np.ndarray
    pixels: np.ndarray
    visible: np.ndarray


@dataclass(frozen=True)
class Alignment:
    """Input of photometric refinement: the skin, its images and the camera."""

    skin: Skin
    strip: FaceStrip
    focal: float
    centre: np.ndarray

    def with_skin(self, skin: Skin) -> Alignment:
        """The same images for other points."""
        return replace(self, skin=skin)

    def take(self, index: np.ndarray) -> Alignment:
        """Some of the frames."""
        return replace(self, strip=self.strip.take(index), centre=self.centre[index])

    def view(self, poses: Poses, frames: np.ndarray) -> View:
        """The skin in the given frames (K,), with their poses among all (T,)."""
        turns = poses.rotation[frames].astype(np.float32).transpose(0, 2, 1)
        points = self.skin.points.astype(np.float32) @ turns
        normals = self.skin.normals.astype(np.float32) @ turns
        in_camera = points + poses.translation[frames, None].astype(np.float32)
        centre = self.centre[frames, None].astype(np.float32)
        pixels = np.float32(self.focal) * in_camera[..., :2] / in_camera[..., 2:] + centre
        visible = -dot(normals, in_camera) >= LEAST_FACING * np.sqrt(dot(in_camera, in_camera))
        return View(turns, points, normals, in_camera, pixels, visible)

    def values(self, frames: np.ndarray, view: View) -> np.ndarray:
        """Grey values (K, N) float32, NaN where not visible."""
        return np.where(view.visible, self.strip.sample(frames, view.pixels), np.float32(np.nan))

    def samples(self, poses: Poses, frames: np.ndarray) -> np.ndarray:
        """Grey values (K, N) of the given frames."""

        def some(part: np.ndarray) -> np.ndarray:
            return self.values(part, self.view(poses, part))

        return np.concatenate(list(in_chunks(some, frames)))


def dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Scalar products (...) of vectors (..., 3); numpy sums so few numbers slowly."""
    return np.asarray(np.einsum("...k,...k->...", one, other))


def in_chunks(work: Callable[[np.ndarray], Any], frames: np.ndarray) -> Iterator[Any]:
    """work(part) of all frames (K,), a few at a time, on a few threads, in order."""
    return in_order(work, ((frames[p : p + CHUNK],) for p in range(0, len(frames), CHUNK)))
