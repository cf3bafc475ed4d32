"""Tracks the faces of a video from frame to frame.

Letters: T frames, P = 478 points of the face mesh, H and W pixels.
"""

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dfrf.ordered import ordered
from dubbing.engine.disk.files import digest_bytes, digest_data
from dubbing.face.finding.face_finder import FaceFinder, region_of
from dubbing.face.finding.regions import Region
from dubbing.media.reading.late_frames import LateFrame

POINTS = 478
Meshes = list[np.ndarray]  # of the faces in a frame, each (478, 3) float32
MAX_FACES = 4
# A face that was lost for longer than this starts a new track.
MEMORY_SECONDS = 1.0
# Two meshes closer than this, in face widths, are one face detected twice.
TWIN = 0.25
# A face belongs to a track whose last face is at most this many face widths away.
MAX_MOTION = 0.6
# Frames of a run. What is found in them depends on nothing before it but where, roughly, faces are.
RUN = 50
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

    def __init__(self, rate: float) -> None:
        self._finder = FaceFinder(MAX_FACES)
        self._memory = max(1, round(rate * MEMORY_SECONDS))
        self._tracks: list[_Track] = []
        self._count = 0
        self._frame = -1
        self._meshes: Meshes = []
        self._begun = ""
        self._key, self._keys = "", 0

    def __call__(
        self,
        frames: Iterable[LateFrame],
        known: Mapping[str, Meshes] | None = None,
        found: dict[str, Meshes] | None = None,
    ) -> Iterator[tuple[LateFrame, str, list[Face]]]:
        """The next frames in order, each with its key and faces.

        Args:
            known: meshes of frames, which are not looked at again.
            found: gets those of these frames, by their keys: by all that they depend on.
        """
        known = known or {}
        for frame, shown, regions in self._with_detected(iter(frames), known, found is not None):
            self._frame += 1
            followed = [region_of(mesh) for mesh in self._meshes]
            if self._frame % RUN == 0:
                followed = [region.rounded() for region in followed]
                self._begun = digest_data([vars(region) for region in followed])
            key = f"{shown} {self._begun}"
            meshes = known.get(key)
            if meshes is None:
                self._finder.follow_on(followed)
                looked = self._finder.follow(frame.image, regions)
                meshes = [mesh.astype(np.float32) for mesh in looked]
            self._meshes = meshes
            if found is not None:
                found[key] = meshes
            yield frame, key, self._assign(meshes)

    def _with_detected(
        self, frames: Iterator[LateFrame], known: Mapping[str, Meshes], keyed: bool
    ) -> Iterator[tuple[LateFrame, str, list[Region] | None]]:
        """Frames, their keys, and regions in which a face is detected; None of known frames."""
        shown = {key.split()[0] for key in known}

        def detect(some: list[LateFrame]) -> list[tuple[LateFrame, str, list[Region] | None]]:
            keys = [self._next_key(frame) if keyed else "" for frame in some]
            if all(key in shown for key in keys):
                return [(frame, key, None) for frame, key in zip(some, keys, strict=True)]
            regions = self._finder.detect([frame.image for frame in some])
            return list(zip(some, keys, regions, strict=True))

        parts = iter(lambda: list(islice(frames, TOGETHER)), [])
        with ThreadPoolExecutor(1) as pool:
            for part in ordered(pool, detect, parts, ahead=1):
                yield from part

    def _next_key(self, frame: LateFrame) -> str:
        """Digest of what the next frame shows, and those before it in its run."""
        before = self._key if self._keys % RUN else ""
        self._keys += 1
        self._key = digest_data([before, frame.key or digest_bytes(frame.image.tobytes())])
        return self._key

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
    late = (LateFrame("", lambda image=image: image) for image in frames)  # type: ignore[misc]
    for _, _, faces in FaceTracker(rate)(late):
        yield faces
