"""The people that a clip is searched for, by portraits; the faces of an image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dubbing.face.finding.landmarks import MOST_FACES, FaceMesh
from dubbing.face.finding.regions import tilt
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.media import MediaInfo, probe, read_frames
from dubbing.preparation.tracking.following import (
    MAX_MOTION,
    Person,
    Place,
    Sighting,
    looks_of,
    track_at,
)
from dubbing.preparation.tracking.likeness import FARTHEST, apart, looks
from dubbing.preparation.tracking.portraits import Portrait

STRIDE = 5  # frames from one that is searched to the next
PORTRAIT_FRAMES = 20  # of a clip, from which the looks of its largest face are taken
ROUND_PLACE = 5  # frames that are searched before a place, and after it
ANOTHER = 1.5 * FARTHEST  # looks of one frame that differ more are another person's, after a cut


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
    mesh = FaceMesh(tracking=False, faces=MOST_FACES)

    def faces(first: int, last: int) -> dict[int, list[Sighting]]:
        images = enumerate(read_frames(portrait.clip, start=first, count=last - first + 1), first)
        searched = [(t, image) for t, image in images if (t - first) % STRIDE == 0]
        found = mesh.find([image for _, image in searched], any_way=True)
        pairs = zip(searched, found, strict=True)
        return {t: sightings_of(points, image, t) for (t, image), points in pairs}

    if rows:
        beside = ROUND_PLACE * STRIDE
        tracks = []
        for row in rows:
            first, last = row.frame - min(row.frame, beside) // STRIDE * STRIDE, row.frame + beside
            tracks.append(track_round(row, faces(first, min(last, whole.frames - 1))))
        return Person(looks=looks_of(tracks))
    spread = np.linspace(0, whole.frames - 1, PORTRAIT_FRAMES).round().astype(int)
    found = [faces(frame, frame)[frame] for frame in np.unique(spread).tolist()]
    track = [max(some, key=lambda face: face.size) for some in found if some]
    if not track:
        raise LookupError(f"in {portrait.clip}, which shows whom to look for")
    return Person(looks=looks_of([track]))


def track_round(place: Place, found: Mapping[int, list[Sighting]]) -> list[Sighting]:
    """A face at a place, and in frames before and after it: one alone may show a grimace.

    Args:
        found: faces by frame, every `STRIDE` frames, that of the place among them.

    Raises:
        LookupError: no face there.
    """
    track = list(track_at([[face] for face in found[place.frame]], place))
    for way in (-STRIDE, STRIDE):
        last, frame = track[0], place.frame + way
        while near := [
            face
            for face in found.get(frame, ())
            if np.hypot(*(face.middle - last.middle)) < MAX_MOTION * last.size
            and apart(looks_of([track]), face.looks[None]) < ANOTHER
        ]:
            last, frame = max(near, key=lambda face: face.size), frame + way
            track.append(last)
    return track


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
            tilt(points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER], :2]),
        )
        for points in faces
    ]
