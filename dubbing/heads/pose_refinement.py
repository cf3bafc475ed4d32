"""Poses of a clip's frames, refined with the learned head of the person in it.

The mouth and the jaw, which speech moves, do not count: only what lies above the base of the nose
is compared. K key frames.
"""

import itertools
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from dfrf.data.dataset import HEAD_MATTE
from dfrf.field.reference_maps import ReferenceMaps
from dfrf.method_interface import Maps, Method
from dfrf.model_interface import HeadModel
from dfrf.presets import method_of
from dfrf.rendering.pose_refinement import PoseObservation, moved, normal_equations
from dfrf.workers import Workers
from dubbing.engine.disk.files import atomic_path
from dubbing.engine.graph.stage import Progress, ReportShare
from dubbing.face.mesh_points import FACE_OVAL, LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER
from dubbing.identity.dataset import upper_face_expression
from dubbing.preparation.alignment.banded import DOF, lower_band, smoothness_blocks, solve_band
from dubbing.preparation.alignment.camera import relative_vectors
from dubbing.preparation.head_findings import POSES_FILE
from dubbing.preparation.prepared import PreparedClip

# Frames and turn (rad) from one key frame to the next, and steps: far ones first, which find what a
# whole shot is off by, so that one step is enough for the near ones: a second finds no better.
# What a pose is off by changes with the pose, so a head that turns fast has a key frame in every
# frame.
PASSES = ((50, np.inf, 4), (5, np.radians(1.5), 1))
RAYS = 500  # twice as many find no better poses
FACE_SHARE = 0.7  # of the rays; hair and ears, which show the turn better, are larger than the face
RIM = 8  # px at 512 beyond the matte: background that a head out of place would cover
NOISE = 0.1  # of a channel; several times what it is, as neighbouring residuals are alike
# How far poses may be off, and how much corrections bend between key frames: radians, units.
SPREAD = np.repeat([0.03, 0.03], 3)
BEND = np.repeat([0.01, 0.013], 3)
AT_ONCE = 8
# Turn from the nearest learned view, rad: up to where corrections count, and from where none does.
SEEN, UNSEEN = np.radians(10.0), np.radians(18.0)


def refined(
    model: HeadModel,
    maps: Maps | None,
    clip: PreparedClip,
    frames: np.ndarray,
    progress: Progress | None = None,
) -> PreparedClip:
    """A clip whose poses of `frames` (F,) lay the learned head on the picture.

    A frame without a face is corrected like those beside it. All poses stay where the method
    refines none, and those of a shot in which no face is seen.

    Args:
        model: of the person; maps: its references.
    """
    method = method_of(model)
    if not method.refines_poses:
        return clip
    wanted = np.zeros(len(clip), bool)
    wanted[frames] = True
    c2w = torch.from_numpy(clip.c2w()).float()
    expression = torch.from_numpy(upper_face_expression(clip)).float()
    corrections = torch.zeros(len(clip), DOF)
    shots = np.unique(clip.segment[wanted & clip.valid])
    for number, shot in enumerate(shots):
        index = np.flatnonzero(wanted & (clip.segment == shot))

        def report(share: float, number: int = number) -> None:
            if progress is not None:
                done = (number + share) / len(shots)
                progress(f"poses of shot {number + 1} of {len(shots)}", done)

        report(0.0)
        found = shot_corrections(method, maps, clip, c2w, expression, index, report)
        corrections[index] = torch.from_numpy(found)
    corrections *= trust(c2w, maps)[:, None]
    return clip.with_poses(moved(c2w, corrections).double().numpy())


def trust(c2w: Tensor, maps: Maps | None) -> Tensor:
    """How much corrections count, (T,) 1..0: a head does not know itself from where it was unseen.

    Args:
        c2w: (T, 3, 4) cameras. maps: references, whose views were learned.
    """
    if not isinstance(maps, ReferenceMaps):
        return torch.ones(len(c2w))
    at, learned = (F.normalize(x[:, :, 3].cpu(), dim=-1) for x in (c2w, maps.views.c2w))
    turn = torch.acos((at @ learned.T).clamp(-1, 1)).amin(1)
    return ((UNSEEN - turn) / (UNSEEN - SEEN)).clamp(0, 1)


def write_poses(clip: PreparedClip, out: Path) -> None:
    """Writes OUT/poses.npz: the poses (T, 3, 4) of all frames of a clip."""
    c2w = clip.c2w()
    with atomic_path(out / POSES_FILE) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, c2w=c2w)


def shot_corrections(
    method: Method[Any, Any],
    maps: Maps | None,
    clip: PreparedClip,
    c2w: Tensor,
    expression: Tensor,
    index: np.ndarray,
    report: ReportShare = lambda share: None,
) -> np.ndarray:
    """Corrections (F, 6) float32 of frames `index` (F,), rising, of one shot; some show a face.

    Args:
        c2w, expression: (T, 3, 4) cameras and (T, U) measures of the upper face, of the whole clip.
        report: called with the share done.
    """
    device = method.model.device
    seen = index[clip.valid[index]]
    rotation = c2w[seen, :, :3].double().numpy()
    passes = [(key_frames(seen, rotation, apart, turn), n) for apart, turn, n in PASSES]
    observations = observations_of(clip, np.unique(np.concatenate([keys for keys, _ in passes])))
    keys, found = seen[:1], np.zeros((1, DOF))
    looks, looked = sum(len(keys) * steps for keys, steps in passes), itertools.count(1)

    def equations(key: tuple[int, PoseObservation, Tensor]) -> tuple[np.ndarray, np.ndarray]:
        number, observation, camera = key
        left, right = normal_equations(heads(number), observation.to(device), camera)
        report(next(looked) / looks)
        return left.cpu().numpy(), right.cpu().numpy()

    with Workers(device, AT_ONCE) as workers:
        for wanted, steps in passes:
            found, keys = between(found, keys, wanted), wanted
            heads = method.resting_heads(expression[keys], c2w[keys, :, 3], maps)
            for _ in range(steps):
                cameras = moved(c2w[keys], torch.from_numpy(found).float()).to(device)
                inputs = zip(itertools.count(), [observations[k] for k in keys], cameras)
                pairs = zip(*workers.map(equations, inputs), strict=True)
                left, right = (np.stack(side).astype(float) / NOISE**2 for side in pairs)
                found = smoothest(left, right + np.einsum("kij,kj->ki", left, found))
    return between(found, keys, index).astype(np.float32)


def key_frames(seen: np.ndarray, rotation: np.ndarray, apart: int, turn: float) -> np.ndarray:
    """Some of the frames `seen` (F,), rising, the first and the last among them.

    Each is the last one that is neither further than `apart` frames from the one before it nor
    turned further than `turn` (rad, along its way), or the very next.

    Args:
        rotation: (F, 3, 3) of each frame.
    """
    way = np.zeros(len(seen))
    if len(seen) > 1:
        way[1:] = np.linalg.norm(relative_vectors(rotation), axis=1).cumsum()
    chosen = [0]
    while chosen[-1] < len(seen) - 1:
        last = chosen[-1]
        near = (seen <= seen[last] + apart) & (way <= way[last] + turn)
        chosen.append(max(last + 1, int(np.flatnonzero(near)[-1])))
    return seen[chosen]


def between(values: np.ndarray, keys: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Values (K, 6) of rising keys (K,) at index (F,), straight from one key to the next."""
    return np.stack([np.interp(index, keys, column) for column in values.T], -1)


def smoothest(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Corrections (K, 6) of small size and bend that meet left (K, 6, 6) x = right (K, 6)."""
    linked = np.zeros(len(left), bool)
    linked[1:-1] = True
    diagonal, *beside = smoothness_blocks(linked, 1 / BEND**2)
    band = lower_band(left + diagonal + np.diag(1 / SPREAD**2), *beside)
    return solve_band(band, right.reshape(-1)).reshape(right.shape)


def observations_of(clip: PreparedClip, keys: np.ndarray) -> dict[int, PoseObservation]:
    """Pixels of key frames (K,), rising, above the base of the nose: `RAYS` of each."""
    observations: dict[int, PoseObservation] = {}
    first, count = int(keys[0]), int(keys[-1] - keys[0]) + 1
    for k, frame in enumerate(clip.film_frames(first, count), first):
        if k in keys:
            pixels = chosen_pixels(frame.matte, clip.landmarks[k], np.random.default_rng(k))
            columns, rows = pixels.T
            observations[k] = PoseObservation(
                pixels=torch.from_numpy(pixels).float(),
                colour=torch.from_numpy(frame.image[rows, columns]).float() / 255,
                background=torch.from_numpy(frame.background[rows, columns]).float() / 255,
                focal=float(clip.focal),
                centre=torch.from_numpy(clip.centre[k]).float(),
            )
    return observations


def chosen_pixels(
    matte: np.ndarray, landmarks: np.ndarray, generator: np.random.Generator
) -> np.ndarray:
    """Pixels (RAYS, 2), column and row, of the head and its rim above the base of the nose.

    None where a frame shows nothing of that.

    Args:
        matte: (S, S) uint8.
        landmarks: (478, 2) px.
    """
    size = len(matte)
    width = 2 * round(RIM * size / 512) + 1
    head = cv2.dilate((matte > HEAD_MATTE).astype(np.uint8), np.ones((width, width), np.uint8))
    oval = cv2.convexHull(landmarks[list(FACE_OVAL)].astype(np.int32))
    face = cv2.fillConvexPoly(np.zeros_like(head), oval, 1)
    eyes = (landmarks[LEFT_EYE_OUTER] + landmarks[RIGHT_EYE_OUTER]) / 2
    down = landmarks[NOSE_BASE] - eyes
    rows, columns = np.nonzero(head)
    above = (columns - eyes[0]) * down[0] + (rows - eyes[1]) * down[1] < 0.9 * (down @ down)
    rows, columns = rows[above], columns[above]
    chosen = []
    for inside, share in ((1, FACE_SHARE), (0, 1 - FACE_SHARE)):
        among = np.flatnonzero(face[rows, columns] == inside)
        if len(among):
            chosen.append(generator.choice(among, round(RAYS * share)))
    pick = np.concatenate([np.zeros(0, int), *chosen])
    return np.stack([columns[pick], rows[pick]], -1)
