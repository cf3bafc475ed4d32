"""First pass over a clip: cuts, faces, and the face to follow.

Every fifth frame is searched for faces; boxes are (x0, y0, x1, y1) in px of the source.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.errors import PreparationError
from dubbing.face.finding.landmarks import MOST_FACES, FaceMesh
from dubbing.media import MediaInfo, read_frames
from dubbing.preparation.tracking.cuts import (
    FLASH,
    LEAST_DIFFERENCE,
    REPEATED,
    find_cuts,
    flashed,
    same_structure,
    segments,
    thumbnail,
)
from dubbing.preparation.tracking.dissolves import detail, find_dissolves, miniature, shown
from dubbing.preparation.tracking.following import (
    Sighting,
    follow,
)
from dubbing.preparation.tracking.portraits import Portrait
from dubbing.preparation.tracking.sought_people import STRIDE, person_of, sightings_of

TOGETHER = 4  # frames that are searched at once
LEAST_SHARE = 0.2  # of searched frames with a face; fewer: search again, larger
TILE_SHARE = 0.5  # of the shorter side of the frame


@dataclass(frozen=True)
class Survey:
    """Frames T: segment (T,) int, repeated (T,) bool, box (T, 4) of the followed face.

    ``turns`` (T,): quarter turns after which it is upright in its shot, see `cropping`.
    ``shown`` (T,): share of a frame that is of its shot; less than 1 in a dissolve. ``distance``
    (shots,): of its looks from the person's, NaN where a shot does not show it; see `following`.
    ``most_faces``: largest number of faces in one frame; ``other``: frame, column and row of the
    largest face that was not followed, NaN without one.
    """

    segment: np.ndarray
    repeated: np.ndarray
    shown: np.ndarray
    box: np.ndarray
    turns: np.ndarray
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
    recent: deque[np.ndarray] = deque(maxlen=FLASH + 1)
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    for frame, image in enumerate(read_frames(info.path, start=first, count=info.frames)):
        small = thumbnail(image)
        if recent:
            difference[frame] = np.abs(small - recent[-1]).mean()
            lit[frame] = difference[frame] > LEAST_DIFFERENCE and same_structure(recent[-1], small)
            white = flashed([*recent], small)
            lit[frame - white : frame + 1] |= white > 0
        recent.append(small)
        miniatures.append(miniature(small))
        details.append(detail(small))
        if frame % STRIDE == 0:
            waiting.append((frame, image))
        if len(waiting) == TOGETHER or frame == info.frames - 1:
            faces = mesh.find([image for _, image in waiting], any_way=True)
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
            "give in `face` where it is: clip, seconds, shares of the frame's width and height",
        ) from error
    repeated = difference < REPEATED
    repeated[0] = False
    most, other = max(map(len, sightings)), other_face(sightings, face.box)
    share = shown(info.frames, dissolves)
    return Survey(segment, repeated, share, face.box, face.turns, face.distance, most, other)


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


def search_tiles(info: MediaInfo, first: int, progress: ReportShare) -> list[list[Sighting]]:
    """Search enlarged, overlapping parts of the frames: the detector misses small faces."""
    out = []
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)
    for frame, image in enumerate(read_frames(info.path, start=first, count=info.frames)):
        if frame % STRIDE == 0:
            faces: list[Sighting] = []
            for tile, corner in tiles(image):
                larger = cv2.resize(tile, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
                faces += sightings_of(
                    mesh.find([larger], any_way=True)[0], larger, frame, corner, 2
                )
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
