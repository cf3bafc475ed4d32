"""Tracks the faces of a video from frame to frame.

Letters: T frames, P = 478 points of the face mesh, H and W pixels.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dfrf.ordered import ordered
from dubbing.face.finding.face_finder import FaceFinder
from dubbing.face.finding.regions import Images, Region

POINTS = 478
MAX_FACES = 4
# A face that was lost for longer than this starts a new track.
MEMORY_SECONDS = 1.0
# Two meshes closer than this, in face widths, are one face detected twice.
TWIN = 0.25
# A face belongs to a track whose last face is at most this many face widths away.
MAX_MOTION = 0.6
TOGETHER = 4  # frames in which faces are detected at once, while those before are followed


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
    """FaceMesh in tracking mode, with one track number a person."""

    def __init__(self, rate: float, max_faces: int = MAX_FACES) -> None:
        self._finder = FaceFinder(max_faces)
        self._memory = max(1, round(rate * MEMORY_SECONDS))
        self._tracks: list[_Track] = []
        self._count = 0
        self._frame = -1

    def __call__(self, frames: Iterable[np.ndarray]) -> Iterator[tuple[np.ndarray, list[Face]]]:
        """The next frames, RGB uint8 (H, W, 3), in order, each with its faces."""
        for frame, regions in self._with_detected(iter(frames)):
            self._frame += 1
            meshes = self._finder.follow(frame, regions)
            yield frame, self._assign([mesh.astype(np.float32) for mesh in meshes])

    def _with_detected(
        self, frames: Iterator[np.ndarray]
    ) -> Iterator[tuple[np.ndarray, list[Region]]]:
        """Frames with the regions in which a face is detected."""

        def detect(some: Images) -> list[tuple[np.ndarray, list[Region]]]:
            return list(zip(some, self._finder.detect(some), strict=True))

        parts = iter(lambda: list(islice(frames, TOGETHER)), [])
        with ThreadPoolExecutor(1) as pool:
            for part in ordered(pool, detect, parts, ahead=1):
                yield from part

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
    for _, faces in FaceTracker(rate)(frames):
        yield faces
