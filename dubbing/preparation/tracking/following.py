"""Which face to follow: sightings linked to tracks, and tracks given to the people of a film.

T frames, N sightings of a face, D figures of its looks. Boxes are (x0, y0, x1, y1) in px.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dubbing.preparation.tracking.likeness import FARTHEST, apart

INSIDE = 0.75  # face heights from its middle that a point may lie
REACH = 0.7  # face sizes a face may move between two searches


@dataclass(frozen=True)
class Sighting:
    """One face in one frame; box (4,) px, looks (D,)."""

    frame: int
    box: np.ndarray
    looks: np.ndarray

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
    """A point (2,) px of a frame that lies in the face that is meant."""

    frame: int
    point: np.ndarray


@dataclass(frozen=True)
class Person:
    """Somebody in the film: places of their face in it, or looks (N, D) from elsewhere."""

    places: tuple[Place, ...] = ()
    looks: np.ndarray | None = None


@dataclass(frozen=True)
class Followed:
    """One face through a clip.

    box (T, 4) px, interpolated between sightings; found (T,) bool: it was seen; distance of its
    looks from the person's (shots,): 0 at a place, NaN where the shot does not show it.
    """

    box: np.ndarray
    found: np.ndarray
    distance: np.ndarray


def follow(sightings: list[Track], segment: np.ndarray, people: Sequence[Person] = ()) -> Followed:
    """The first of these people; without any, the largest face of every shot.

    The largest is the track with the most face height over time: size and presence together.

    Args:
        sightings: of each searched frame.
        segment: (T,) number of the shot.
        people: of the film. Tracks go to those whom they look like, each to one.

    Raises:
        LookupError: no face at a place, or none that is like the person's.
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
    box, found = boxes(chosen, segment)
    return Followed(box, found, distance)


def assign(
    shots: list[list[Track]], segment: np.ndarray, people: Sequence[Person]
) -> list[tuple[int, Track, float]]:
    """The first person's tracks, each with its shot and its distance from their looks.

    A track at a place is theirs whose place it is. All others go to whom they are most like, the
    surest first; nobody is at two places at a time.

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
    """Box (T, 4) of a face, and (T,) bool whether it was seen there.

    Boxes between sightings are interpolated, shots without one take the nearest.
    """
    chosen = sorted(chosen, key=lambda face: face.frame)
    at = np.array([face.frame for face in chosen])
    seen = np.stack([face.box for face in chosen])
    every = np.arange(len(segment))
    box = np.stack([np.interp(every, at, seen[:, k]) for k in range(4)], axis=1)
    found = np.zeros(len(segment), bool)
    found[at] = True
    for first, last in pairwise(np.flatnonzero(np.diff(segment, prepend=-1, append=-2))):
        inside = found[first:last]
        if inside.any():  # nothing is interpolated across a cut
            seen_at = first + np.flatnonzero(inside)
            for k in range(4):
                box[first:last, k] = np.interp(every[first:last], seen_at, box[seen_at, k])
    return box, found


def tracks_of(sightings: Sequence[Track], segment: np.ndarray, shot: int) -> list[Track]:
    """The faces of a shot, linked from frame to frame by nearness."""
    tracks: list[Track] = []
    for seen in sightings:
        for face in seen:
            if segment[face.frame] == shot:
                add_to_tracks(tracks, face)
    return tracks


def track_at(tracks: list[Track], place: Place) -> Track:
    """The track that passes nearest to a place.

    Raises:
        LookupError: none comes within half a face.
    """

    def away(track: Track) -> float:
        seen = min(track, key=lambda face: abs(face.frame - place.frame))
        return float(np.hypot(*(seen.middle - place.point))) / seen.size

    best = min(tracks, key=away, default=None)
    if best is None or away(best) > INSIDE:
        x, y = place.point
        raise LookupError(f"at the point ({x:.0f}, {y:.0f}) px of frame {place.frame}")
    return best


def add_to_tracks(tracks: list[Track], face: Sighting) -> None:
    """Append a sighting to the nearest track within reach, or begin a track with it."""

    def distance(track: Track) -> float:
        return float(np.hypot(*(track[-1].middle - face.middle)))

    open_tracks = [t for t in tracks if t[-1].frame < face.frame]
    best = min(open_tracks, key=distance, default=None)
    if best is not None and distance(best) < REACH * max(face.size, best[-1].size):
        best.append(face)
    else:
        tracks.append([face])
