"""A first look through the clip: cuts, faces, and which face to follow.

Every fifth frame is searched for faces; boxes are (x0, y0, x1, y1) in px of the source.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from dubbing.errors import PreparationError
from dubbing.face.landmarks import MOST_FACES, FaceMesh
from dubbing.media import MediaInfo, read_frames
from dubbing.preparation.tracking.cuts import REPEATED, find_cuts, segments, thumbnail

STRIDE = 5  # frames
LEAST_SHARE = 0.2  # of searched frames with a face; fewer: search again, larger
TILE_SHARE = 0.5  # of the shorter side of the frame
INSIDE = 0.75  # face heights from its middle that a point may lie
REACH = 0.7  # face sizes a face may move between two searches


@dataclass(frozen=True)
class Survey:
    """Frames T: segment (T,) int, repeated (T,) bool, box (T, 4) of the followed face.

    ``found`` (T,) bool: boxes that were seen; the others are interpolated. ``followed`` (T,) bool:
    the shot shows the face. ``most_faces``: how many faces one frame showed at most.
    """

    segment: np.ndarray
    repeated: np.ndarray
    box: np.ndarray
    found: np.ndarray
    followed: np.ndarray
    most_faces: int


@dataclass(frozen=True)
class Sighting:
    """One face in one frame; box (4,) px."""

    frame: int
    box: np.ndarray

    @property
    def size(self) -> float:
        """Height of the box in px."""
        return float(self.box[3] - self.box[1])

    @property
    def middle(self) -> np.ndarray:
        """Middle (2,) of the box in px."""
        return (self.box[:2] + self.box[2:]) / 2


# A point inside a face: seconds, and shares of the frame's width and height.
Point = tuple[float, float, float]


def survey(
    info: MediaInfo, progress: Callable[[float], None], points: Sequence[Point] = ()
) -> Survey:
    """Look through a clip.

    Args:
        points: where the face is that is meant; without any it is the largest of every shot.

    Raises:
        PreparationError: no face in it, or none at a point.
    """
    difference = np.zeros(info.frames)
    sightings: list[list[Sighting]] = []
    before: np.ndarray | None = None
    with FaceMesh(tracking=False, faces=MOST_FACES) as mesh:
        for frame, image in enumerate(read_frames(info.path)):
            small = thumbnail(image)
            difference[frame] = 0 if before is None else np.abs(small - before).mean()
            before = small
            if frame % STRIDE == 0:
                sightings.append(sight(mesh, image, frame))
            progress((frame + 1) / info.frames)
    if sum(map(bool, sightings)) < LEAST_SHARE * len(sightings):
        sightings = search_tiles(info.path, info.frames, progress)
    if not any(sightings):
        raise PreparationError(
            "no face found in any frame",
            str(info.path),
            "use a clip that shows one person's face from the front, at least 64 px high",
        )
    segment = segments(info.frames, find_cuts(difference))
    assert info.rate is not None
    places = [
        Place(
            min(round(at * info.rate), info.frames - 1), np.array([x * info.width, y * info.height])
        )
        for at, x, y in points
    ]
    try:
        box, found, followed = follow(sightings, segment, places)
    except LookupError as error:
        raise PreparationError(
            f"no face at the point {error}",
            str(info.path),
            "say in `face` where it is: seconds, shares of the frame's width and height",
        ) from error
    repeated = difference < REPEATED
    repeated[0] = False
    return Survey(segment, repeated, box, found, followed, max(map(len, sightings)))


def sight(
    mesh: FaceMesh,
    image: np.ndarray,
    frame: int,
    corner: tuple[int, int] = (0, 0),
    scale: float = 1,
) -> list[Sighting]:
    """Faces in a picture whose first pixel lies at ``corner`` of the source, enlarged ``scale``."""
    boxes = [
        np.concatenate((points[:, :2].min(0), points[:, :2].max(0))) / scale + (corner * 2)
        for points in mesh(image)
    ]
    return [Sighting(frame, box) for box in boxes]


def search_tiles(
    path: Path, frames: int, progress: Callable[[float], None]
) -> list[list[Sighting]]:
    """Search enlarged, overlapping parts of the frames: the detector misses small faces."""
    out = []
    with FaceMesh(tracking=False, faces=MOST_FACES) as mesh:
        for frame, image in enumerate(read_frames(path)):
            if frame % STRIDE == 0:
                seen: list[Sighting] = []
                for tile, corner in tiles(image):
                    larger = cv2.resize(tile, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
                    seen += sight(mesh, larger, frame, corner, 2)
                out.append(without_doubles(seen))
            progress((frame + 1) / frames)
    return out


def tiles(image: np.ndarray) -> Iterator[tuple[np.ndarray, tuple[int, int]]]:
    """Square parts, half of the shorter side, half overlapping, with their first pixels (x, y)."""
    height, width = image.shape[:2]
    side = max(1, int(min(height, width) * TILE_SHARE))
    for y in [*range(0, height - side, side // 2), height - side]:
        for x in [*range(0, width - side, side // 2), width - side]:
            yield image[y : y + side, x : x + side], (x, y)


def without_doubles(seen: list[Sighting]) -> list[Sighting]:
    """One sighting per face: the largest of those whose middles lie within half a face."""
    kept: list[Sighting] = []
    for face in sorted(seen, key=lambda s: -s.size):
        if all(np.hypot(*(face.middle - other.middle)) > other.size / 2 for other in kept):
            kept.append(face)
    return kept


@dataclass(frozen=True)
class Place:
    """A point (2,) px of a frame that lies in the face that is meant."""

    frame: int
    point: np.ndarray


def follow(
    sightings: list[list[Sighting]], segment: np.ndarray, places: Sequence[Place] = ()
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Box (T, 4) of the followed face; (T,) bool: whether it was seen, whether its shot shows it.

    In every shot, sightings are linked to tracks by nearness; the track with the most face height
    over time wins: size and presence together. Where places are given, it is the one that lies
    there, and shots without a place are not followed. Boxes between sightings are interpolated,
    shots without a face take the nearest box.

    Raises:
        LookupError: no face at a place.
    """
    frames = len(segment)
    chosen: list[Sighting] = []
    for shot in range(segment[-1] + 1):
        tracks: list[list[Sighting]] = []
        for seen in sightings:
            for face in seen:
                if segment[face.frame] == shot:
                    add_to_tracks(tracks, face)
        own = [place for place in places if segment[place.frame] == shot]
        if own:
            chosen += [face for place in own for face in track_at(tracks, place)]
        elif tracks and not places:
            chosen += max(tracks, key=lambda track: sum(face.size for face in track))
    chosen.sort(key=lambda face: face.frame)
    at = np.array([face.frame for face in chosen])
    boxes = np.stack([face.box for face in chosen])
    every = np.arange(frames)
    box = np.stack([np.interp(every, at, boxes[:, k]) for k in range(4)], axis=1)
    found = np.zeros(frames, bool)
    found[at] = True
    for first, last in pairwise(np.flatnonzero(np.diff(segment, prepend=-1, append=-2))):
        inside = found[first:last]
        if inside.any():  # nothing is interpolated across a cut
            seen_at = first + np.flatnonzero(inside)
            for k in range(4):
                box[first:last, k] = np.interp(every[first:last], seen_at, box[seen_at, k])
    return box, found, np.isin(segment, segment[at])


def track_at(tracks: list[list[Sighting]], place: Place) -> list[Sighting]:
    """The track that passes nearest to a place.

    Raises:
        LookupError: none comes within half a face.
    """

    def away(track: list[Sighting]) -> float:
        seen = min(track, key=lambda face: abs(face.frame - place.frame))
        return float(np.hypot(*(seen.middle - place.point))) / seen.size

    best = min(tracks, key=away, default=None)
    if best is None or away(best) > INSIDE:
        x, y = place.point
        raise LookupError(f"({x:.0f}, {y:.0f}) px of frame {place.frame}")
    return best


def add_to_tracks(tracks: list[list[Sighting]], face: Sighting) -> None:
    """Append a sighting to the nearest track within reach, or begin a track with it."""

    def distance(track: list[Sighting]) -> float:
        return float(np.hypot(*(track[-1].middle - face.middle)))

    open_tracks = [t for t in tracks if t[-1].frame < face.frame]
    best = min(open_tracks, key=distance, default=None)
    if best is not None and distance(best) < REACH * max(face.size, best[-1].size):
        best.append(face)
    else:
        tracks.append([face])
