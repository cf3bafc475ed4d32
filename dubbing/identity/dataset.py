"""From a prepared clip to the tensors that training and rendering take."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from dfrf.cameras import project
from dfrf.data.dataset import EYES, HEAD, HEAD_MATTE, MOUTH, RIM, HeadDataset
from dfrf.field.mouth_views import region
from dubbing.errors import TrainingError
from dubbing.face.lip_measures import lip_measures, lips_touch
from dubbing.face.mesh_points import EYE_CORNERS, RIGID
from dubbing.face.mouth_shape import INNER_LIP, OUTER_LIP
from dubbing.identity.picture_store import PictureStore
from dubbing.preparation.alignment.silhouette import eye_axes, upwards
from dubbing.preparation.prepared import PreparedClip
from dubbing.sound_to_lips.speech_frames import SpeechFrames

# Of each eye: inner and outer corner, middle of the upper and of the lower lid, brow, iris.
EYES_POINTS = ((133, 33, 159, 145, 105, 468), (362, 263, 386, 374, 334, 473))
# What counts as 1, in eye distances.
LIDS, BROWS, GAZE = 0.1, 0.03, 0.01
RIM_WIDTH = 0.016  # of the crop's side


def mouth_boxes(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Box round the lips with a margin, (T, 4) left, top, right, bottom, from (T, 478, 2)."""
    lips = landmarks[:, OUTER_LIP]
    low, high = lips.min(1), lips.max(1)
    half = (high - low) / 2
    centre = (high + low) / 2
    wide = half[:, 0] * 1.25
    tall = np.maximum(half[:, 1] * 1.4, wide * 0.6)
    boxes = np.stack(
        [centre[:, 0] - wide, centre[:, 1] - tall, centre[:, 0] + wide, centre[:, 1] + tall], -1
    )
    return np.clip(np.nan_to_num(boxes).round(), 0, size).astype(np.int64)


def lid_openings(points: np.ndarray) -> np.ndarray:
    """How far the left and the right eye are open, (T, 2) in eye distances, of (T, 478, 2)."""
    _, right, unit = eye_axes(points[:, list(EYE_CORNERS)])
    upper, lower = ([eye[k] for eye in EYES_POINTS] for k in (2, 3))
    between = (points[:, upper] - points[:, lower]) * upwards(right)[:, None]
    return between.sum(-1) / unit[:, None]


def upper_face_expression(clip: PreparedClip) -> np.ndarray:
    """How far lids and brows are up and where the eyes look, (T, 6), 0 where no face was found.

    Opening of the lids and height of the brow of the left and of the right eye, gaze of both to the
    right and downwards, the order of `MIRRORED_EXPRESSION` in `dfrf.data.dataset`: in units of the
    distance between the eyes, less their medians over the clip. Speech does not determine them, so
    the field is conditioned on them: a rendered frame takes them, like its pose, from the clip.
    """
    points = clip.landmarks
    _, right, unit = eye_axes(points[:, list(EYE_CORNERS)])
    down = -upwards(right)
    raised, looks = [], []
    for inner, outer, _, _, brow, iris in EYES_POINTS:
        corners = (points[:, inner] + points[:, outer]) / 2
        raised.append(((corners - points[:, brow]) * down).sum(-1) / BROWS)
        looks.append((points[:, iris] - corners) / GAZE)
    look = (looks[0] + looks[1]) / 2
    gaze = [(look * right).sum(-1), (look * down).sum(-1)]
    measures = np.stack([*raised, *gaze], -1) / unit[:, None]
    measures = np.concatenate([lid_openings(points) / LIDS, measures], -1)
    middle = np.median(measures[clip.valid], 0)
    return np.where(clip.valid[:, None], measures - middle, 0.0)


def eye_boxes(landmarks: np.ndarray, size: int) -> np.ndarray:
    """Boxes round each eye with its brow, (T, 2, 4) left, top, right, bottom, of (T, 478, 2)."""
    boxes = []
    for points in EYES_POINTS:
        eye = landmarks[:, points]
        low, high = eye.min(1), eye.max(1)
        margin = (high[:, 0] - low[:, 0]) * 0.25
        boxes.append(np.concatenate([low - margin[:, None], high + margin[:, None]], -1))
    return np.clip(np.nan_to_num(np.stack(boxes, 1)).round(), 0, size).astype(np.int64)


def region_map(matte: np.ndarray, mouth: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Where to draw rays, (S, S) uint8 codes of `dfrf.data`, from a matte (S, S) uint8.

    The rim lies on both sides of the head's outline; boxes are left, top, right, bottom in pixels,
    one of the mouth (4,) and two of the eyes (2, 4).
    """
    width = max(2, round(RIM_WIDTH * matte.shape[0]))
    kernel = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
    head = (matte > HEAD_MATTE).astype(np.uint8)
    region = np.where(cv2.dilate(head, kernel) > 0, RIM, 0).astype(np.uint8)
    region[cv2.erode(head, kernel, borderValue=0) > 0] = HEAD
    for code, (left, top, right, bottom) in ((EYES, eyes[0]), (EYES, eyes[1]), (MOUTH, mouth)):
        box = region[top:bottom, left:right]
        box[box == HEAD] = code
    return region


def load_identity(
    name: str,
    clip: PreparedClip,
    speech: SpeechFrames,
    frames: np.ndarray,
    *,
    every: int = 1,
    folder: Path | None = None,
) -> HeadDataset:
    """Frames of a prepared clip, those without a face left out.

    Args:
        name: of the person, for messages.
        clip: what `prepare` made of the film.
        speech: of every frame of the clip.
        frames: (F,) of the clip, in their order. What is heard at one is not joined to another that
            does not follow it without a gap.
        every: keep the picture of one frame of so many.
        folder: where the pictures lie, see `PictureStore`; in memory when None.

    Raises:
        TrainingError: no frame shows a face.
        DubbingError: the folder's disk is full.
    """
    usable = clip.valid[frames]
    speaking = frames[usable]
    number = np.flatnonzero(np.flatnonzero(usable) % every == 0)
    index = speaking[number]
    if not len(index):
        where = f"frames {frames[0]} to {frames[-1]}" if len(frames) else "past its end"
        raise TrainingError(
            "no frame with a face to learn from",
            f"{clip.clip.name}, {where}",
            "choose another start for this identity",
        )
    keep = set(index.tolist())
    landmarks = clip.landmarks[index]
    boxes = zip(mouth_boxes(landmarks, clip.size), eye_boxes(landmarks, clip.size), strict=True)
    grey = (len(index), clip.size, clip.size)
    shapes = {"images": (*grey, 3), "backgrounds": (*grey, 3), "mattes": grey, "regions": grey}
    store = PictureStore(shapes, folder)
    gaps = np.cumsum(np.diff(frames, prepend=frames[0]) > 1)
    for gap in np.unique(gaps):
        first, count = int(frames[gaps == gap][0]), int((gaps == gap).sum())
        for k, (image, matte, background) in enumerate(clip.frames(first, count), first):
            if k in keep:
                regions = region_map(matte, *next(boxes))
                store.add(images=image, backgrounds=background, mattes=matte, regions=regions)
    return HeadDataset(
        name=name,
        **store.tensors(),
        c2w=torch.from_numpy(clip.c2w()[index]).float(),
        focal=float(clip.focal),
        centres=torch.from_numpy(clip.centre[index]).float(),
        expression=torch.from_numpy(upper_face_expression(clip)[index]).float(),
        number=torch.from_numpy(number),
        windows=torch.from_numpy(speech.windows[speaking]).float(),
        predicted_lips=torch.from_numpy(speech.lips[speaking]).float(),
        lips=torch.from_numpy(lip_measures(clip.landmarks[speaking])).float(),
        touching=torch.from_numpy(lips_touch(clip.landmarks[speaking])).float(),
        segment=torch.from_numpy(
            clip.segment[speaking] + gaps[usable] * (clip.segment.max() + 1)
        ).long(),
        surface=surface_points(clip),
        lip_shape=lip_shape(clip),
        lip_points=lip_points(clip, index),
    )


def surface_points(clip: PreparedClip) -> Tensor:
    """Rigid points of the person's mean face in the head frame, y up, (V, 3)."""
    points = clip.shape[list(RIGID)] * np.array([1.0, -1.0, -1.0])
    return torch.from_numpy(points).float()


def lip_shape(clip: PreparedClip) -> Tensor:
    """Points of the lips of the person's mean face in the head frame, y up, (40, 3)."""
    points = clip.shape[[*OUTER_LIP, *INNER_LIP]] * np.array([1.0, -1.0, -1.0])
    return torch.from_numpy(points).float()


def lip_points(clip: PreparedClip, frames: np.ndarray) -> Tensor:
    """How far the lips of frames lie beside those of the mean face, (T, 40, 2) right and down.

    Head units, in the picture: pixels over the focal length times the distance of the mouth.
    """
    c2w = torch.from_numpy(clip.c2w()[frames]).float()
    centre = torch.from_numpy(clip.centre[frames]).float()
    shape = lip_shape(clip)
    still = project(shape, c2w, float(clip.focal), centre)
    seen = torch.from_numpy(clip.landmarks[frames][:, [*OUTER_LIP, *INNER_LIP]]).float()
    unit = float(clip.focal) / (c2w[:, :, 3] - region(shape)[0]).norm(dim=-1)
    return (seen - still) / unit[:, None, None]
