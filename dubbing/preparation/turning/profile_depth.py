"""How far a face stands out, read off the outline of its profile.

FaceMesh guesses depth from the front: lips and chin of its mean shape stand out too far by a
centimetre and more. Where a head is turned, its outline shows how far they do.

Head frame as in :class:`PreparedClip`: x right, y down, the face along -z. T frames, B heights.
"""

from __future__ import annotations

import warnings

import cv2
import numpy as np

from dubbing.face.mesh_points import CHIN, FOREHEAD_TOP
from dubbing.preparation.alignment.camera import Poses, project, to_camera
from dubbing.preparation.turning.turned import Footage

TURNED = np.radians(50.0)  # from here on, the middle of the face makes its outline
MESH = 468  # points without irises, which lie behind the lids
HEIGHTS = 24  # from the top of the forehead to the chin
FEWEST = 10  # frames
FURTHEST = 0.6  # units between the outlines of mesh and picture
STEP = 0.01  # units of a way
# Units: heights at which frames differ by more, or where the outline lies further off, as hair
# does, tell nothing.
UNLIKE, MOST = 0.1, 0.3
MIDDLE = (0.35, 0.8)  # units from the middle of the face between which nothing moves any more
HALF = 127  # of 255


def stood_out(shape: np.ndarray, poses: Poses, turn: np.ndarray, footage: Footage) -> np.ndarray:
    """The mean shape (478, 3) with the depth that outlines of profiles show.

    Args:
        shape: (478, 3). poses: of T frames.
        turn: (T,) rad between the face and the camera; NaN where that is not known.
    """
    some = np.flatnonzero(turn > TURNED)
    if len(some) < FEWEST:
        return shape
    edges = np.linspace(shape[FOREHEAD_TOP, 1], shape[CHIN, 1], HEIGHTS + 1)
    height = np.digitize(shape[:MESH, 1], edges) - 1
    focal, people = footage.surface.focal, (footage.people[t] for t in some)
    in_camera = to_camera(poses[some], shape[:MESH])
    seen = project(in_camera, focal, footage.centre[some])
    found = [
        _beyond(points, -turn[:2, 2] * focal / depth, mask, height)
        for points, turn, depth, mask in zip(
            seen, poses.rotation[some], in_camera[..., 2].mean(1), people, strict=True
        )
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # heights at which nothing was found
        usual = np.nanmedian(found, 0)
        unlike = np.nanmedian(np.abs(found - usual), 0)
    told = (np.abs(usual) < MOST) & (unlike < UNLIKE) & (np.isfinite(found).mean(0) > 0.5)
    middles = (edges[1:] + edges[:-1]) / 2
    if told.sum() < HEIGHTS / 2:
        return shape
    near, far = MIDDLE
    share = np.clip((far - np.abs(shape[:, 0])) / (far - near), 0, 1)
    share = share * share * (3 - 2 * share)
    out = shape.copy()
    out[:, 2] -= share * np.interp(shape[:, 1], middles[told], usual[told])
    return out


def _beyond(
    points: np.ndarray, ahead: np.ndarray, mask: np.ndarray, height: np.ndarray
) -> np.ndarray:
    """How far a person's outline lies beyond the mesh at each height, (B,) units; NaN: not seen.

    Args:
        points: (MESH, 2) px. ahead: (2,) px that a unit ahead of the face is.
        mask: (S, S) uint8. height: (MESH,) numbers.
    """
    outermost = points @ ahead
    order = np.lexsort((outermost, height))
    last = np.searchsorted(height[order], np.arange(HEIGHTS), side="right") - 1
    there = order[last]
    ways = np.arange(-FURTHEST, FURTHEST, STEP)
    at = points[there][:, None] + ways[:, None] * ahead
    columns, rows = at.astype(np.float32).transpose(2, 0, 1)
    inside = cv2.remap(mask, columns, rows, cv2.INTER_LINEAR) > HALF
    edge = np.argmin(inside, axis=1)  # the first place outside
    known = inside[:, 0] & ~inside.all(1) & (height[there] == np.arange(HEIGHTS))
    return np.where(known, ways[edge], np.nan)
