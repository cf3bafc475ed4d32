"""Poses of heads that are turned far: from points that are followed, not from landmarks.

Landmarks of a face that is turned by 60 degrees are wrong by ten, and beyond 75 none are found. But
hair, ear, cheek and brow can be followed from the frontal frames on. Poses of the turned frames and
the places of the followed points are solved together; the frontal poses stay. T frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.preparation.alignment.camera import Poses
from dubbing.preparation.turning.head_surface import HeadSurface
from dubbing.preparation.turning.point_tracks import follow
from dubbing.preparation.turning.structure import Structure

FRONTAL = np.radians(20.0)  # between the face and the camera: up to here landmarks decide
FARTHEST = np.radians(105.0)  # beyond, nothing of a face is seen
ANCHORS = 25  # frontal frames beside the turned ones, whose poses stay
AT_ONCE = 120  # turned frames that are solved together
LEAST_POINTS = 20  # in a frame
FEWEST = 8  # frontal frames of a shot


@dataclass(frozen=True)
class Footage:
    """The pictures and masks that poses are found from.

    Attributes:
        crops: (T, S, S, 3), people: (T, S, S) person masks, uint8.
        centre: (T, 2) principal points, px. segment: (T,) number of the shot.
        surface: of the head.
    """

    crops: np.ndarray
    people: np.ndarray
    centre: np.ndarray
    segment: np.ndarray
    surface: HeadSurface


def angles(poses: Poses) -> np.ndarray:
    """Angle (T,) between where a head looks and the way to the camera, rad."""
    towards = -np.einsum("tji,tj->ti", poses.rotation, poses.translation)
    cosine = -towards[:, 2] / np.linalg.norm(towards, axis=1)
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


def frontal(poses: Poses, valid: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Frames (T,) bool whose landmarks can be trusted; all of a shot that has few such frames.

    Args:
        valid: (T,) frames with landmarks.
    """
    trusted = valid & (angles(poses) < FRONTAL)
    few = [shot for shot in np.unique(segment) if trusted[segment == shot].sum() < FEWEST]
    return trusted | (valid & np.isin(segment, few))


def follow_turned(poses: Poses, trusted: np.ndarray, footage: Footage) -> tuple[Poses, np.ndarray]:
    """Poses with those of turned heads as they were followed, and which frames have one, (T,).

    Args:
        poses: of trusted frames, and rough ones of the others. trusted: (T,) see `frontal`.
    """
    rotation, translation = poses.rotation.copy(), poses.translation.copy()
    known = trusted.copy()
    for shot in np.unique(footage.segment):
        index = np.flatnonzero(footage.segment == shot)
        if not trusted[index].any():
            continue
        edges = np.flatnonzero(np.diff(trusted[index], prepend=True, append=True))
        for low, high in edges.reshape(-1, 2).tolist():
            for part in parts_of(low, high, len(index)):
                frames = index[part]
                start = Poses(rotation[frames], translation[frames])
                found, seen = _solved(start, ~known[frames], footage, frames)
                rotation[frames], translation[frames] = found.rotation, found.translation
                known[frames] |= seen
    return Poses(rotation, translation), known


def turned_step(
    bundle: dict[str, np.ndarray],
    track: dict[str, np.ndarray],
    footage: Footage,
    progress: ReportShare,
) -> dict[str, np.ndarray]:
    """Poses of all frames: refined ones where landmarks are trusted, followed ones elsewhere.

    Args:
        bundle: rough poses, and which frames are trusted. track: refined poses.

    Returns:
        rotation, translation; known (T,) bool.
    """
    trusted = bundle["trusted"]
    poses = Poses(
        np.where(trusted[:, None, None], track["rotation"], bundle["rotation"]),
        np.where(trusted[:, None], track["translation"], bundle["translation"]),
    )
    poses, known = follow_turned(poses, trusted, footage)
    progress(1.0)
    return {"rotation": poses.rotation, "translation": poses.translation, "known": known}


def parts_of(low: int, high: int, count: int) -> list[slice]:
    """Frames low .. high in parts of `AT_ONCE`, each with `ANCHORS` frames to both sides."""
    return [
        slice(max(0, k - ANCHORS), min(count, min(high, k + AT_ONCE) + ANCHORS))
        for k in range(low, high, AT_ONCE)
    ]


def _solved(
    start: Poses, free: np.ndarray, footage: Footage, frames: np.ndarray
) -> tuple[Poses, np.ndarray]:
    """Poses of frames (F,) in a row, and which are known; those that are not free stay."""
    parts = (footage.crops[t] for t in frames), (footage.people[t] for t in frames)
    centre = footage.centre[frames]
    tracks = follow(*parts, start, centre, footage.surface)
    points = np.bincount(tracks.frame, minlength=len(frames))
    if len(frames) < 3 or free.all() or not len(tracks.places):
        return start, np.zeros(len(frames), bool)
    poses = Structure(tracks, footage.surface.focal, centre).poses(start, free)
    held = points >= LEAST_POINTS
    # Only what is joined to a frame whose pose is known, frame by frame, has a pose.
    run = np.cumsum(~held)
    reached = np.isin(run, run[~free & held]) & held
    sure = np.flatnonzero(reached | ~free)
    # The motion of a head does not go on where nothing of it is followed, as at the end of a shot.
    nearest = np.arange(len(frames)).clip(sure[0], sure[-1])
    return poses[nearest], reached & (angles(poses) < FARTHEST)
