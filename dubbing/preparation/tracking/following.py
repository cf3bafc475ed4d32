"""Chooses the face to follow: links sightings to tracks, and assigns tracks to people.

T frames, N sightings of a face, D numbers of its looks. Boxes are (x0, y0, x1, y1) in px.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dubbing.face.mesh_points import RIGID
from dubbing.preparation.tracking.likeness import FARTHEST, apart

INSIDE = 0.75  # face heights, largest distance of a point from the middle of its face
MAX_MOTION = 0.7  # face sizes, between two searches
BESIDE, STRAY = 3, 0.35  # frames before and after; face sizes from the middle of their places


@dataclass(frozen=True)
class Sighting:
    """One face in one frame; box (4,) px, looks (D,), tilt clockwise in radians."""

    frame: int
    box: np.ndarray
    looks: np.ndarray
    tilt: float = 0.0

    @property
    def size(self) -> float:
        """Height of the box in px."""
        return float(self.box[3] - self.box[1])

    @property
    def middle(self) -> np.ndarray:
        """Middle (2,) of the box in px."""
        return (self.box[:2] + self.box[2:]) / 2


Track = list[Sighting]


@dataclass(frozen=True)
class Place:
    """A point (2,) px of a frame that lies in the person's face."""

    frame: int
    point: np.ndarray


@dataclass(frozen=True)
class Person:
    """A person in the clip: places of their face in it, or looks (N, D) from another clip."""

    places: tuple[Place, ...] = ()
    looks: np.ndarray | None = None


@dataclass(frozen=True)
class Followed:
    """One face through a clip.

    box (T, 4) px, interpolated between sightings; sighted (T,) bool: the frame has a sighting;
    turns (T,): quarter turns counterclockwise after which it is upright, the same in a shot;
    distance of its looks from the person's (shots,): 0 at a place, NaN where the shot does not show
    it.
    """

    box: np.ndarray
    sighted: np.ndarray
    turns: np.ndarray
    distance: np.ndarray


def follow(sightings: list[Track], segment: np.ndarray, people: Sequence[Person] = ()) -> Followed:
    """Follows the first of these people; without any, the largest face of every shot.

    The largest is the track with the largest sum of face heights: size times duration.

    Args:
        sightings: of each searched frame.
        segment: (T,) number of the shot.
        people: in the clip. Each track is assigned to the person that it looks most like.

    Raises:
        LookupError: no face at a place, or none that looks like the person.
    """
    shots = [tracks_of(sightings, segment, shot) for shot in range(segment[-1] + 1)]
    distance = np.full(len(shots), np.nan)
    chosen: Track = []
    if people:
        for shot, track, away in assign(shots, segment, people):
            chosen += track
            distance[shot] = np.nanmax([distance[shot], away])
        if not chosen:
            raise LookupError("like theirs")
    else:
        for shot, tracks in enumerate(shots):
            if tracks:
                chosen += max(tracks, key=lambda track: sum(face.size for face in track))
                distance[shot] = 0
    box, sighted = boxes(chosen, segment)
    return Followed(box, sighted, quarter_turns(chosen, segment), distance)


def assign(
    shots: list[list[Track]], segment: np.ndarray, people: Sequence[Person]
) -> list[tuple[int, Track, float]]:
    """The first person's tracks, each with its shot and its distance from their looks.

    A track at a place belongs to that person. All others are assigned by likeness, the most similar
    first; a person has at most one face in a frame.

    Raises:
        LookupError: no face at a place.
    """
    held: list[list[tuple[int, Track, float]]] = [[] for _ in people]
    for person, own in zip(people, held, strict=True):
        for place in person.places:
            shot = int(segment[place.frame])
            track = track_at(shots[shot], place)
            if all(track is not other for _, other, _ in own):
                own.append((shot, track, 0.0))
    taken = [track for own in held for _, track, _ in own]
    pairs = []
    for person, own in zip(people, held, strict=True):
        looks = looks_of([t for _, t, _ in own]) if person.looks is None else person.looks
        for shot, tracks in enumerate(shots):
            for track in tracks:
                pairs.append((apart(looks, looks_of([track])), shot, track, own))
    for away, shot, track, own in sorted(pairs, key=lambda pair: pair[0]):
        elsewhere = any(where == shot and at_once(track, other) for where, other, _ in own)
        if away <= FARTHEST and not elsewhere and all(track is not other for other in taken):
            own.append((shot, track, away))
            taken.append(track)
    return held[0]


def looks_of(tracks: Sequence[Track]) -> np.ndarray:
    """Looks (N, D) of all sightings."""
    return np.stack([face.looks for track in tracks for face in track])


def at_once(one: Track, other: Track) -> bool:
    """Whether two tracks show a face in the same frame."""
    return not {face.frame for face in one}.isdisjoint(face.frame for face in other)


def boxes(chosen: Track, segment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box (T, 4) of a face, and (T,) bool whether it was sighted in a frame.

    Boxes between sightings are interpolated; shots without one take the nearest.
    """
    chosen = sorted(chosen, key=lambda face: face.frame)
    at = np.array([face.frame for face in chosen])
    sighted_boxes = np.stack([face.box for face in chosen])
    every = np.arange(len(segment))
    box = np.stack([np.interp(every, at, sighted_boxes[:, k]) for k in range(4)], axis=1)
    sighted = np.zeros(len(segment), bool)
    sighted[at] = True
    for first, last in pairwise(np.flatnonzero(np.diff(segment, prepend=-1, append=-2))):
        inside = sighted[first:last]
        if inside.any():  # nothing is interpolated across a cut
            where = first + np.flatnonzero(inside)
            for k in range(4):
                box[first:last, k] = np.interp(every[first:last], where, box[where, k])
    return box, sighted


def quarter_turns(chosen: Track, segment: np.ndarray) -> np.ndarray:
    """Quarter turns (T,), 0 to 3, after which the mean face of each shot is upright."""
    along = np.zeros(segment[-1] + 1, complex)
    for face in chosen:
        along[segment[face.frame]] += np.exp(1j * face.tilt)
    return np.asarray((np.angle(along) / (np.pi / 2)).round().astype(int) % 4)[segment]


def tracks_of(sightings: Sequence[Track], segment: np.ndarray, shot: int) -> list[Track]:
    """The faces of a shot, linked from frame to frame by nearness."""
    tracks: list[Track] = []
    for faces in sightings:
        for face in faces:
            if segment[face.frame] == shot:
                add_to_tracks(tracks, face)
    return tracks


def track_at(tracks: list[Track], place: Place) -> Track:
    """The track that passes nearest to a place.

    Raises:
        LookupError: none comes within `INSIDE` of it.
    """

    def away(track: Track) -> float:
        face = min(track, key=lambda face: abs(face.frame - place.frame))
        return float(np.hypot(*(face.middle - place.point))) / face.size

    best = min(tracks, key=away, default=None)
    if best is None or away(best) > INSIDE:
        x, y = place.point
        raise LookupError(f"at the point ({x:.0f}, {y:.0f}) px of frame {place.frame}")
    return best


def add_to_tracks(tracks: list[Track], face: Sighting) -> None:
    """Append a sighting to the nearest track within `MAX_MOTION`, or start a track with it."""

    def distance(track: Track) -> float:
        return float(np.hypot(*(track[-1].middle - face.middle)))

    open_tracks = [t for t in tracks if t[-1].frame < face.frame]
    best = min(open_tracks, key=distance, default=None)
    if best is not None and distance(best) < MAX_MOTION * max(face.size, best[-1].size):
        best.append(face)
    else:
        tracks.append([face])


def strays(points: np.ndarray, valid: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Frames (T,) bool whose face lies far beside that of most frames around: somebody else's.

    A head on its way, however fast, lies in the middle of as many places before and after.

    Args:
        points: (T, 478, 3) px. valid: (T,) frames with a face. segment: (T,) number of the shot.
    """
    found = np.zeros(len(valid), bool)
    for shot in np.unique(segment):
        own = np.flatnonzero(valid & (segment == shot))
        faces = points[own][:, list(RIGID), :2]
        places, size = faces.mean(1), np.ptp(faces, axis=1).max(1, initial=1.0)
        order = np.arange(len(own))
        before = order - np.searchsorted(own, own - BESIDE)
        after = np.searchsorted(own, own + BESIDE, "right") - 1 - order
        for k, reach in enumerate(np.minimum(before, after)):
            near = slice(k - reach, k + reach + 1)
            away = np.linalg.norm(places[k] - np.median(places[near], 0))
            found[own[k]] = away > STRAY * np.median(size[near])
    return found
