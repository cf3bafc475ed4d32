"""First pass over a clip: cuts, faces, and the face to follow.

Every fifth frame is searched for faces; boxes are (x0, y0, x1, y1) in px of the source.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.errors import PreparationError
from dubbing.face.finding.landmarks import MOST_FACES, FaceMesh
from dubbing.media import MediaInfo, probe, read_frames
from dubbing.preparation.tracking.cuts import (
    LEAST_DIFFERENCE,
    REPEATED,
    find_cuts,
    same_structure,
    segments,
    thumbnail,
)
from dubbing.preparation.tracking.dissolves import detail, find_dissolves, miniature, shown
from dubbing.preparation.tracking.following import (
    Person,
    Place,
    Sighting,
    follow,
    looks_of,
    track_at,
)
from dubbing.preparation.tracking.likeness import looks
from dubbing.preparation.tracking.portraits import Portrait

STRIDE = 5  # frames
TOGETHER = 4  # frames that are searched at once
LEAST_SHARE = 0.2  # of searched frames with a face; fewer: search again, larger
TILE_SHARE = 0.5  # of the shorter side of the frame
PORTRAIT_FRAMES = 20  # of another clip, from which a person's looks are taken


@dataclass(frozen=True)
class Survey:
    """Frames T: segment (T,) int, repeated (T,) bool, box (T, 4) of the followed face.

    ``shown`` (T,): share of a frame that is of its shot; less than 1 in a dissolve. ``distance``
    (shots,): of its looks from the person's, NaN where a shot does not show it; see `following`.
    ``most_faces``: largest number of faces in one frame; ``other``: frame, column and row of the
    largest face that was not followed, NaN without one.
    """

    segment: np.ndarray
    repeated: np.ndarray
    shown: np.ndarray
    box: np.ndarray
    distance: np.ndarray
    most_faces: int
    other: np.ndarray


def survey(
    info: MediaInfo, progress: ReportShare, people: Sequence[Portrait] = (), first: int = 0
) -> Survey:
    """Search a clip, or a part of it, for cuts and faces, and choose the face to follow.

    Args:
        info: of the frames that are searched. first: of them in the clip.
        people: the person, then the others in the clip; without any, the largest face of every
            shot is followed.

    Raises:
        PreparationError: no face in it, or none at a point, or none like that of a portrait.
    """
    difference, lit = np.zeros(info.frames), np.zeros(info.frames, bool)
    miniatures: list[np.ndarray] = []
    details: list[float] = []
    sightings: list[list[Sighting]] = []
    waiting: list[tuple[int, np.ndarray]] = []
    before: np.ndarray | None = None
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    for frame, image in enumerate(read_frames(info.path, start=first, count=info.frames)):
        small = thumbnail(image)
        if before is not None:
            difference[frame] = np.abs(small - before).mean()
            lit[frame] = difference[frame] > LEAST_DIFFERENCE and same_structure(before, small)
        before = small
        miniatures.append(miniature(small))
        details.append(detail(small))
        if frame % STRIDE == 0:
            waiting.append((frame, image))
        if len(waiting) == TOGETHER or frame == info.frames - 1:
            faces = mesh.find([image for _, image in waiting])
            for (t, searched), points in zip(waiting, faces, strict=True):
                sightings.append(sightings_of(points, searched, t))
            waiting = []
        progress((frame + 1) / info.frames)
    if sum(map(bool, sightings)) < LEAST_SHARE * len(sightings):
        sightings = search_tiles(info, first, progress)
    if not any(sightings):
        raise PreparationError(
            "no face found in any frame",
            str(info.path),
            "use a clip that shows one person's face from the front, at least 64 px high",
        )
    dissolves = find_dissolves(np.stack(miniatures), np.array(details))
    cuts = find_cuts(difference, lit)
    segment = segments(info.frames, np.union1d(cuts, [d.middle for d in dissolves]).astype(int))
    try:
        known = [person_of(portrait, info, first) for portrait in people]
        face = follow(sightings, segment, known)
    except LookupError as error:
        raise PreparationError(
            f"no face {error}",
            str(info.path),
            "give in `face` where it is: seconds, shares of the frame's width and height",
        ) from error
    repeated = difference < REPEATED
    repeated[0] = False
    most, other = max(map(len, sightings)), other_face(sightings, face.box)
    share = shown(info.frames, dissolves)
    return Survey(segment, repeated, share, face.box, face.distance, most, other)


def other_face(sightings: list[list[Sighting]], box: np.ndarray) -> np.ndarray:
    """Frame, column and row (3,) of the largest face outside of the followed boxes (T, 4)."""
    others = [
        face
        for faces in sightings
        for face in faces
        if np.hypot(*(face.middle - (box[face.frame, :2] + box[face.frame, 2:]) / 2))
        > face.size / 2
    ]
    if not others:
        return np.full(3, np.nan)
    largest = max(others, key=lambda face: face.size)
    return np.array([largest.frame, *largest.middle])


def person_of(portrait: Portrait, info: MediaInfo, first: int = 0) -> Person:
    """The person of a portrait, as a clip, or the part of it from a frame on, is searched for them.

    Raises:
        LookupError: no face at a point of the portrait, or none in it.
    """
    whole = probe(portrait.clip)
    rows = places(portrait, whole)
    if portrait.clip == info.path:
        here = tuple(replace(row, frame=row.frame - first) for row in rows)
        if all(0 <= row.frame < info.frames for row in here):
            return Person(here)
    spread = np.linspace(0, whole.frames - 1, PORTRAIT_FRAMES).round().astype(int)
    frames = [place.frame for place in rows] or np.unique(spread).tolist()
    track: list[Sighting] = []
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    for k, frame in enumerate(frames):
        (image,) = read_frames(portrait.clip, start=frame, count=1)
        faces = sightings_of(mesh(image), image, frame)
        if rows:
            track += track_at([[face] for face in faces], rows[k])
        elif faces:
            track.append(max(faces, key=lambda face: face.size))
    if not track:
        raise LookupError(f"in {portrait.clip}, which shows whom to look for")
    return Person(looks=looks_of([track]))


def places(portrait: Portrait, info: MediaInfo) -> tuple[Place, ...]:
    """The points of a portrait as frames and pixels of its clip."""
    size = np.array([info.width, info.height])
    return tuple(
        Place(min(round(at * info.rate), info.frames - 1), np.array([x, y]) * size)
        for at, x, y in portrait.points
    )


def sightings_of(
    faces: list[np.ndarray],
    image: np.ndarray,
    frame: int,
    corner: tuple[int, int] = (0, 0),
    scale: float = 1,
) -> list[Sighting]:
    """Faces (478, 3) of an image that begins at ``corner`` of the source, enlarged by ``scale``."""
    return [
        Sighting(
            frame,
            np.concatenate((points[:, :2].min(0), points[:, :2].max(0))) / scale + (corner * 2),
            looks(image, points),
        )
        for points in faces
    ]


def search_tiles(info: MediaInfo, first: int, progress: ReportShare) -> list[list[Sighting]]:
    """Search enlarged, overlapping parts of the frames: the detector misses small faces."""
    out = []
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    for frame, image in enumerate(read_frames(info.path, start=first, count=info.frames)):
        if frame % STRIDE == 0:
            faces: list[Sighting] = []
            for tile, corner in tiles(image):
                larger = cv2.resize(tile, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
                faces += sightings_of(mesh(larger), larger, frame, corner, 2)
            out.append(without_doubles(faces))
        progress((frame + 1) / info.frames)
    return out


def tiles(image: np.ndarray) -> Iterator[tuple[np.ndarray, tuple[int, int]]]:
    """Square parts, half of the shorter side, half overlapping, with their first pixels (x, y)."""
    height, width = image.shape[:2]
    side = max(1, int(min(height, width) * TILE_SHARE))
    for y in [*range(0, height - side, side // 2), height - side]:
        for x in [*range(0, width - side, side // 2), width - side]:
            yield image[y : y + side, x : x + side], (x, y)


def without_doubles(sightings: list[Sighting]) -> list[Sighting]:
    """One sighting per face: the largest of those whose middles lie within half a face."""
    kept: list[Sighting] = []
    for face in sorted(sightings, key=lambda s: -s.size):
        if all(np.hypot(*(face.middle - other.middle)) > other.size / 2 for other in kept):
            kept.append(face)
    return kept
