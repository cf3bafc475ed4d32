"""Tensors for training and rendering from prepared clips."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor

from dfrf.cameras import project
from dfrf.data.dataset import EYES, HEAD, HEAD_MATTE, MOUTH, RIM, HeadDataset
from dfrf.field.mouth_pixels import region
from dubbing.errors import TrainingError
from dubbing.face.eyes import eye_axes, upwards
from dubbing.face.mesh_points import EYE_CORNERS, RIGID
from dubbing.face.mouth.lip_measures import lip_measures, lips_touch
from dubbing.face.mouth.mouth_shape import LIPS, OUTER_LIP
from dubbing.identity.clip_frames import ClipFrames, placed
from dubbing.identity.image_store import ImageStore
from dubbing.preparation.prepared import PreparedClip

# Of each eye: inner and outer corner, middle of the upper and of the lower lid, brow, iris.
EYES_POINTS = ((133, 33, 159, 145, 105, 468), (362, 263, 386, 374, 334, 473))
# Lengths that count as 1, in eye distances.
LIDS, BROWS, GAZE = 0.1, 0.03, 0.01
MOST_EXPRESSION = 4.0  # of these, to either side of the median
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
    """Opening of the left and the right eye, (T, 2) in eye distances, of (T, 478, 2)."""
    _, right, unit = eye_axes(points[:, list(EYE_CORNERS)])
    upper, lower = ([eye[k] for eye in EYES_POINTS] for k in (2, 3))
    between = (points[:, upper] - points[:, lower]) * upwards(right)[:, None]
    return between.sum(-1) / unit[:, None]


def upper_face_expression(clip: PreparedClip) -> np.ndarray:
    """Measures of lids, brows and gaze, (T, 6), 0 where no face was detected.

    Opening of the lids and height of the brow of the left and of the right eye, gaze of both to the
    right and downwards, the order of `MIRRORED_EXPRESSION` in `dfrf.data.dataset`: in units of the
    distance between the eyes, minus their medians over the clip, as seen from the front. Speech
    does not determine them, so the field is conditioned on them: a rendered frame takes them, like
    its pose, from the clip.
    """
    points = clip.frontal_landmarks()
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
    middle = np.median(measures[clip.detected], 0)
    # Eyes that are hardly seen give any number, and a field that knows no such number has holes.
    known = np.clip(measures - middle, -MOST_EXPRESSION, MOST_EXPRESSION)
    return np.where(clip.detected[:, None], known, 0.0)


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
    name: str, clips: Sequence[ClipFrames], *, every: int = 1, folder: Path | None = None
) -> HeadDataset:
    """Frames of a person's clips, without those that show no face.

    Camera and face shape are those of the first clip, and so is the size of images: those of other
    clips are scaled as if they were taken with that camera.

    Args:
        name: of the person, for messages.
        every: keep the image of one frame of so many.
        folder: for the images, see `ImageStore`; in memory when None.

    Raises:
        TrainingError: no frame shows a face.
        ExplainedError: the folder's disk is full.
    """
    first = clips[0].clip
    ends = np.cumsum([0, *(len(one.with_face) for one in clips)])
    number = [
        np.flatnonzero(np.flatnonzero(one.clip.detected[one.frames]) % every == 0) for one in clips
    ]
    if not (many := sum(map(len, number))):
        frames = clips[0].frames
        where = f"frames {frames[0]} to {frames[-1]}" if len(frames) else "past its end"
        raise TrainingError(
            "no frame with a face to learn from",
            f"{first.clip.name}, {where}",
            "choose another start for this identity",
        )
    grey = (many, first.size, first.size)
    shapes = {"images": (*grey, 3), "backgrounds": (*grey, 3), "mattes": grey, "regions": grey}
    store = ImageStore(shapes, folder)
    shots = 0
    parts: dict[str, list[np.ndarray]] = {}
    for one, which, at in zip(clips, number, ends, strict=False):
        clip, speech, speaking = one.clip, one.speech, one.with_face
        if not len(speaking):
            continue
        index, spoken = speaking[which], clip.spoken()
        gaps = np.cumsum(np.diff(one.frames, prepend=one.frames[:1]) > 1)
        _add_images(store, one, gaps, which, first)
        runs = gaps[clip.detected[one.frames]] * (clip.segment.max() + 1)
        segment = clip.segment[speaking] + runs
        for field, values in {
            "c2w": clip.c2w()[index],
            "centres": placed(clip.centre[index], one.taken_by(first)),
            "expression": upper_face_expression(clip)[index],
            "number": which + at,
            "windows": speech.windows[speaking],
            "predicted_lips": speech.lips[speaking],
            "lips": lip_measures(spoken.frontal_landmarks()[speaking]),
            # The lips of the mean face do not touch, so those seen from the front hardly do.
            "touching": lips_touch(spoken.landmarks[speaking], clip.eye_distances()[speaking]),
            "segment": segment + shots,
            "lip_points": lip_points(clip, index).numpy(),
        }.items():
            parts.setdefault(field, []).append(values)
        shots += int(segment.max()) + 1
    joined = {field: torch.from_numpy(np.concatenate(values)) for field, values in parts.items()}
    return HeadDataset(
        name=name,
        **store.tensors(),
        **{
            field: t if field in ("number", "segment") else t.float() for field, t in joined.items()
        },
        focal=float(first.focal),
        surface=mean_face(first, RIGID),
        lip_shape=mean_face(first, LIPS),
    )


def _add_images(
    store: ImageStore,
    selected: ClipFrames,
    gaps: np.ndarray,
    which: np.ndarray,
    camera: PreparedClip,
) -> None:
    """Adds the images of a clip's frames to a store, as the camera of a clip takes them.

    Args:
        gaps: number of the run without a gap that each frame is in, (F,).
        which: of the frames that show the face.
    """
    clip, keep = selected.clip, set(selected.with_face[which].tolist())
    landmarks, size, how = selected.landmarks(camera)[which], camera.size, selected.taken_by(camera)
    boxes = zip(mouth_boxes(landmarks, size), eye_boxes(landmarks, size), strict=True)
    for gap in np.unique(gaps):
        first, count = int(selected.frames[gaps == gap][0]), int((gaps == gap).sum())
        for k, images in enumerate(clip.frames(first, count), first):
            if k in keep:
                image, matte, background = (scaled(one, how, size) for one in images)
                regions = region_map(matte, *next(boxes))
                store.add(images=image, backgrounds=background, mattes=matte, regions=regions)


def scaled(image: np.ndarray, how: np.ndarray, size: int) -> np.ndarray:
    """An image (S, S[, 3]) after a similarity (2, 3), `size` px wide, its edge replicated."""
    ratio = how[0, 0]
    if ratio == 1 and size == len(image):
        return image
    if ratio < 1:  # else pixels would be left out
        image = cv2.GaussianBlur(image, (0, 0), 0.5 / ratio)
    return cv2.warpAffine(image, how, (size, size), borderMode=cv2.BORDER_REPLICATE)


def mean_face(clip: PreparedClip, points: Sequence[int]) -> Tensor:
    """Points of the person's mean face in the head frame, y up, (V, 3)."""
    return torch.from_numpy(clip.shape[list(points)] * np.array([1.0, -1.0, -1.0])).float()


def lip_points(clip: PreparedClip, frames: np.ndarray) -> Tensor:
    """Positions of the lips relative to those of the mean face, (T, 40, 2) right and down.

    Head units, in the image: pixels over the focal length times the distance of the mouth.
    """
    c2w = torch.from_numpy(clip.c2w()[frames]).float()
    centre = torch.from_numpy(clip.centre[frames]).float()
    shape = mean_face(clip, LIPS)
    mean_lips = project(shape, c2w, float(clip.focal), centre)
    lips = torch.from_numpy(clip.landmarks[frames][:, LIPS]).float()
    unit = float(clip.focal) / (c2w[:, :, 3] - region(shape)[0]).norm(dim=-1)
    return (lips - mean_lips) / unit[:, None, None]
