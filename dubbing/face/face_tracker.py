"""Tracks the faces of a video from frame to frame.

Letters: T frames, P = 478 points of the face mesh, H and W pixels.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dubbing.face.face_finder import FaceFinder

POINTS = 478
MAX_FACES = 4
# A face that was lost for longer than this starts a new track.
MEMORY_SECONDS = 1.0
# Two meshes closer than this, in face widths, are one face detected twice.
TWIN = 0.25
# A face belongs to a track whose last face is at most this many face widths away.
MAX_MOTION = 0.6


@dataclass(frozen=True)
class Face:
    """One face in one frame: track number and points (478, 3) as (column, row, depth) in pixels."""

    track: int
    points: np.ndarray


@dataclass
class _Track:
    number: int
    centre: np.ndarray
    width: float
    last_frame: int


class FaceTracker:
    """FaceMesh in tracking mode, with one track number a person.

    Feed it the frames in order.
    """

    def __init__(self, rate: float, max_faces: int = MAX_FACES) -> None:
        self._finder = FaceFinder(max_faces)
        self._memory = max(1, round(rate * MEMORY_SECONDS))
        self._tracks: list[_Track] = []
        self._count = 0
        self._frame = -1

    def __call__(self, frame: np.ndarray) -> list[Face]:
        """Faces of the next frame, RGB uint8 (H, W, 3)."""
        self._frame += 1
        return self._assign([mesh.astype(np.float32) for mesh in self._finder.follow(frame)])

    def _assign(self, meshes: list[np.ndarray]) -> list[Face]:
        self._tracks = [t for t in self._tracks if self._frame - t.last_frame <= self._memory]
        meshes = _without_twins(meshes)
        places = [_place(m) for m in meshes]
        pairs = sorted(
            (float(np.linalg.norm(centre - t.centre)) / max(width, t.width, 1.0), i, t.number)
            for i, (centre, width) in enumerate(places)
            for t in self._tracks
        )
        chosen: dict[int, int] = {}
        for distance, i, number in pairs:
            if distance < MAX_MOTION and i not in chosen and number not in chosen.values():
                chosen[i] = number
        faces = []
        for i, (centre, width) in enumerate(places):
            number = chosen.get(i, self._count)
            self._count += number == self._count
            self._tracks = [t for t in self._tracks if t.number != number]
            self._tracks.append(_Track(number, centre, width, self._frame))
            faces.append(Face(number, meshes[i]))
        return faces


def _place(mesh: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (2,) and width of a face, pixels."""
    return mesh[:, :2].mean(0), float(np.ptp(mesh[:, 0]))


def _without_twins(meshes: list[np.ndarray]) -> list[np.ndarray]:
    kept: list[np.ndarray] = []
    for mesh in meshes:
        centre, width = _place(mesh)
        if all(np.linalg.norm(centre - _place(k)[0]) > TWIN * width for k in kept):
            kept.append(mesh)
    return kept


def track_faces(frames: Iterable[np.ndarray], rate: float) -> Iterator[list[Face]]:
    """Faces of each frame in order; the frames are not kept."""
    yield from map(FaceTracker(rate), frames)
