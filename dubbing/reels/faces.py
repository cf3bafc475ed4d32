"""The faces of several clips: which are of one person, where they are, and a sheet of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from dubbing.engine.disk.files import atomic_write_bytes
from dubbing.face.finding.landmarks import MOST_FACES, FaceMesh
from dubbing.media import MediaInfo, read_frames
from dubbing.preparation.tracking.following import Sighting
from dubbing.preparation.tracking.likeness import FARTHEST, apart
from dubbing.preparation.tracking.sought_people import sightings_of
from dubbing.preparation.tracking.survey import tiles, without_doubles

LOOKED_AT = 12  # frames of a clip
LEAST_SEEN = 2  # times: what is seen once may be no face
CELL, COLUMNS, AROUND = 200, 5, 1.6  # px; thumbnails of a person; heights of a face
QUALITY = 90  # of JPEG


@dataclass(frozen=True)
class Seen:
    """A face in a clip: when, at which shares of width and height, and what is round it."""

    clip: str
    at: float
    x: float
    y: float
    sighting: Sighting
    image: np.ndarray


class Face:
    """Somebody, as often as they were seen."""

    def __init__(self, first: Seen) -> None:
        self.seen = [first]

    @property
    def clips(self) -> list[str]:
        """Names of the clips that show it, that which shows it largest first."""
        largest = sorted(self.seen, key=lambda one: -one.sighting.size)
        return list(dict.fromkeys(one.clip for one in largest))

    def best(self, clip: str) -> Seen:
        """Where it is largest in a clip."""
        return max((s for s in self.seen if s.clip == clip), key=lambda one: one.sighting.size)

    def apart(self, one: Seen) -> float:
        """How far its looks are from those of another sighting."""
        return apart(np.stack([s.sighting.looks for s in self.seen]), one.sighting.looks[None])


def faces_of(clips: dict[str, MediaInfo]) -> list[Face]:
    """Everybody in clips, by the clips' names; those that are seen most come first."""
    found: list[Face] = []
    for name, info in clips.items():
        for seen in frames_of(name, info):
            new = []
            free = [*found]  # one frame shows nobody twice
            for one in sorted(seen, key=lambda one: -one.sighting.size):
                like = min(free, key=lambda face: face.apart(one), default=None)
                if like is not None and like.apart(one) < FARTHEST:
                    like.seen.append(one)
                    free.remove(like)
                else:
                    new.append(Face(one))
            found += new
    often = [face for face in found if len(face.seen) >= LEAST_SEEN]
    return sorted(often, key=lambda face: -len(face.seen))


def frames_of(name: str, info: MediaInfo) -> Iterator[list[Seen]]:
    """The faces of some frames of a clip, from its beginning to its end."""
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    spread = np.linspace(0, info.frames - 1, LOOKED_AT + 2).round().astype(int)[1:-1]
    for frame in np.unique(spread).tolist():
        for image in read_frames(info.path, start=frame, count=1):
            found = sightings_of(mesh.find([image], any_way=True)[0], image, frame)
            if not found:  # the finder misses small faces
                for tile, corner in tiles(image):
                    larger = cv2.resize(tile, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
                    some = mesh.find([larger], any_way=True)[0]
                    found += sightings_of(some, larger, frame, corner, 2)
            height, width = image.shape[:2]
            yield [
                Seen(name, frame / float(info.rate), x / width, y / height, one, cut)
                for one in without_doubles(found)
                if (cut := around(image, one)).size
                for x, y in [one.middle.tolist()]
            ]


def around(image: np.ndarray, face: Sighting) -> np.ndarray:
    """The square round a face, (CELL, CELL, 3); smaller than nothing outside of the image."""
    half = max(2, round(AROUND * face.size / 2))
    x, y = face.middle.round().astype(int)
    part = image[max(0, y - half) : y + half, max(0, x - half) : x + half]
    return cv2.resize(part, (CELL, CELL), interpolation=cv2.INTER_AREA) if part.size else part


def write_sheet(faces: Sequence[Face], path: Path) -> None:
    """Write a row a face as JPEG: its number, counted from 1, and it in some of its clips."""
    rows = []
    for number, face in enumerate(faces, 1):
        row = np.zeros((CELL, (COLUMNS + 1) * CELL, 3), np.uint8)
        place = (CELL // 4, CELL * 2 // 3)
        cv2.putText(row, str(number), place, cv2.FONT_HERSHEY_SIMPLEX, 3, (255, 255, 255), 5)
        for k, clip in enumerate(face.clips[:COLUMNS], 1):
            row[:, k * CELL : (k + 1) * CELL] = face.best(clip).image
        rows.append(row)
    sheet = np.concatenate(rows)[..., ::-1]
    _, data = cv2.imencode(".jpg", sheet, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    atomic_write_bytes(path, data.tobytes())
