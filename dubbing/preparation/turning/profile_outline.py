"""Tilt and depth of a face, read off the outline of its profile.

FaceMesh guesses depth from the front: lips and chin of its mean shape may stand out too far by a
centimetre. And poses that were followed from the front on drift. Both show where a head is turned:
the outline of the mesh lies beside that of the person.

Head frame as in :class:`PreparedClip`: x right, y down, the face along -z. T frames, K of them
profiles; B heights.
"""

from __future__ import annotations

import warnings

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dubbing.face.mesh_points import CHIN, FOREHEAD_TOP, NOSE_BASE
from dubbing.preparation.alignment.camera import Poses, project, rotation_from_vector, to_camera
from dubbing.preparation.turning.turned import Footage

# Turns from which the middle of the face makes its outline, and from which poses are corrected.
TURNED, WHOLE = np.radians(50.0), np.radians(60.0)
MESH = 468  # points without irises, which lie behind the lids
HEIGHTS = 24  # from the top of the forehead to the chin
MOUTH = 0.75  # from here on, of the way from the base of the nose to the chin, words move nothing
FEWEST = 10  # frames
FURTHEST = 0.6  # units between the outlines of mesh and picture
STEP = 0.01  # units of a way
# Units: heights at which frames differ by more, or where the outline lies further off, as hair
# does, tell nothing.
UNLIKE, MOST = 0.1, 0.3
MIDDLE = (0.35, 0.8)  # units from the middle of the face between which nothing moves any more
ROUNDS, HUBER = 8, 0.03  # of the fit of a line; units
LEAST_HEIGHTS = 6
DRIFT = 15  # frames over which a drift is even
HALF = 127  # of 255


def outlined(
    shape: np.ndarray, poses: Poses, turn: np.ndarray, footage: Footage
) -> tuple[np.ndarray, Poses]:
    """The mean shape (478, 3) and the poses that outlines of profiles show.

    Args:
        shape: (478, 3). poses: of T frames.
        turn: (T,) rad between the face and the camera; NaN where that is not known.
    """
    some = np.flatnonzero(turn > TURNED)
    if len(some) < FEWEST:
        return shape, poses
    edges = np.linspace(shape[FOREHEAD_TOP, 1], shape[CHIN, 1], HEIGHTS + 1)
    heights = (edges[1:] + edges[:-1]) / 2
    number = np.digitize(shape[:MESH, 1], edges) - 1
    beyond, levers = _beyond(shape[:MESH], poses[some], footage, some, number)
    nose, chin = shape[NOSE_BASE, 1], shape[CHIN, 1]
    firm = (heights < nose) | (heights > nose + MOUTH * (chin - nose))
    tilts = np.array([_tilt(*pair, firm) for pair in zip(beyond, levers, strict=True)])
    tilts = gaussian_filter1d(tilts, DRIFT, mode="nearest")
    share = np.clip((turn[some] - TURNED) / (WHOLE - TURNED), 0, 1)
    rotation = poses.rotation.copy()
    about = np.outer(share * tilts, [0.0, 0.0, 1.0])
    rotation[some] = rotation_from_vector(about) @ rotation[some]
    depth = _depth(beyond - tilts[:, None] * levers, heights)
    near, far = MIDDLE
    middle = np.clip((far - np.abs(shape[:, 0])) / (far - near), 0, 1)
    middle = middle * middle * (3 - 2 * middle)
    out = shape.copy()
    out[:, 2] -= middle * np.interp(shape[:, 1], heights, depth)
    return out, Poses(rotation, poses.translation)


def _beyond(
    shape: np.ndarray, poses: Poses, footage: Footage, frames: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How far a person's outline lies beyond the mesh at each height, (K, B) units; NaN: not seen.

    And by how much that changes with a turn in the picture, (K, B) units a rad.

    Args:
        shape: (MESH, 3). poses: of K frames. number: (MESH,) of the height of each point.
    """
    focal, centre = footage.surface.focal, footage.centre[frames]
    in_camera = to_camera(poses, shape)
    seen = project(in_camera, focal, centre)
    axis = project(poses.translation[:, None], focal, centre)[:, 0]
    # Px that a unit ahead of the face is.
    ahead = -poses.rotation[:, :2, 2] * (focal / in_camera[..., 2].mean(1))[:, None]
    found = np.full((2, len(frames), HEIGHTS), np.nan)
    for k, t in enumerate(frames):
        order = np.lexsort((seen[k] @ ahead[k], number))
        last = order[np.searchsorted(number[order], np.arange(HEIGHTS), side="right") - 1]
        ways = np.arange(-FURTHEST, FURTHEST, STEP)
        at = seen[k, last][:, None] + ways[:, None] * ahead[k]
        columns, rows = at.astype(np.float32).transpose(2, 0, 1)
        inside = cv2.remap(footage.people[t], columns, rows, cv2.INTER_LINEAR) > HALF
        known = inside[:, 0] & ~inside.all(1) & (number[last] == np.arange(HEIGHTS))
        edge = ways[np.argmin(inside, axis=1)]  # the first place outside
        right, down = (seen[k, last] - axis[k]).T
        lever = (down * -ahead[k, 0] + right * ahead[k, 1]) / (ahead[k] @ ahead[k])
        found[:, k, known] = edge[known], lever[known]
    return found[0], found[1]


def _tilt(beyond: np.ndarray, levers: np.ndarray, firm: np.ndarray) -> float:
    """The turn in the picture, rad, that lays a mesh along an outline, of one frame.

    Args:
        beyond, levers: (B,); see `_beyond`. firm: (B,) heights that words do not move.
    """
    told = firm & (np.abs(beyond) < MOST)
    if told.sum() < LEAST_HEIGHTS:
        return 0.0
    terms, wanted = np.column_stack([np.ones(told.sum()), levers[told]]), beyond[told]
    weight = np.ones(len(wanted))
    for _ in range(ROUNDS):
        found = np.linalg.lstsq(terms * weight[:, None], wanted * weight, rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(1, np.abs(wanted - terms @ found) / HUBER))
    return float(found[1])


def _depth(beyond: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """How far the face stands out beyond the mesh at each height (B,), of outlines (K, B) units."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # heights at which nothing was found
        usual = np.nanmedian(beyond, 0)
        unlike = np.nanmedian(np.abs(beyond - usual), 0)
    told = (np.abs(usual) < MOST) & (unlike < UNLIKE) & (np.isfinite(beyond).mean(0) > 0.5)
    if told.sum() < HEIGHTS / 2:
        return np.zeros(HEIGHTS)
    return np.interp(heights, heights[told], usual[told])
