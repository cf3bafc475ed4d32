"""Mends the poses of frames in which something hides a face; see `covers`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dfrf.method_interface import Maps, Method
from dubbing.face.mesh_points import RIGID
from dubbing.heads.comparison import AWRY, Comparison, off_by
from dubbing.heads.pose_refinement import refined
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.prepared import PreparedClip

FITTING = 0.2  # eye distances of a firm point from that of the mean face


def with_poses_mended(
    method: Method[Any, Any],
    maps: Maps | None,
    clip: PreparedClip,
    run: np.ndarray,
    usual: np.ndarray,
) -> tuple[PreparedClip, set[int]]:
    """The clip with other poses and landmarks of those frames of a run whose head lies awry.

    What hides a face moves its landmarks. The pose begins between those of the frames around, and
    is refined; landmarks that do not fit it become those of the mean face in that pose. Where that
    lies no better, as where a head is shaken, all stays.

    Returns:
        The clip, and these frames.
    """
    before = np.array([off_by(c, usual) for c in Comparison(method, maps, clip).look(run)])
    awry = run[before > AWRY]
    beside_face = set(awry.tolist())
    awry = np.intersect1d(run, np.add.outer(awry, (-1, 0, 1)))
    rest = np.flatnonzero(clip.valid & (clip.segment == clip.segment[run[0]]))
    rest = np.setdiff1d(rest, awry)
    if not len(awry) or not len(rest):
        return clip, beside_face
    rotation, translation = clip.rotation.copy(), clip.translation.copy()
    turns = Slerp(rest, Rotation.from_matrix(clip.rotation[rest])) if len(rest) > 1 else None
    inside = awry[(awry > rest[0]) & (awry < rest[-1])]
    if turns is not None and len(inside):
        rotation[inside] = turns(inside).as_matrix()
        for axis in range(3):
            translation[inside, axis] = np.interp(inside, rest, clip.translation[rest, axis])
    between = replace(clip, rotation=rotation, translation=translation)
    posed = refined(method.model, maps, between, awry)
    landmarks = clip.landmarks.copy()
    poses = Poses(posed.rotation[awry], posed.translation[awry])
    mean = project(to_camera(poses, clip.shape), clip.focal, clip.centre[awry])
    off = np.linalg.norm((landmarks[awry] - mean)[:, list(RIGID)], axis=2).max(1)
    fit = off < FITTING * clip.eye_distances()[awry]
    landmarks[awry] = np.where(fit[:, None, None], landmarks[awry], mean)
    posed = replace(posed, landmarks=landmarks)
    after = np.array([off_by(c, usual) for c in Comparison(method, maps, posed).look(awry)])
    worse = awry[after > before[np.isin(run, awry)]]
    for array, old in (
        (posed.rotation, clip.rotation),
        (posed.translation, clip.translation),
        (posed.landmarks, clip.landmarks),
    ):
        array[worse] = old[worse]
    return posed, beside_face
