"""A film beside the learned head: where the head does not explain what the film shows.

The head is rendered for every frame with the lips that the film shows. Both are compared in the
frame of the face, W x H pixels: upright, with the outer corners of the eyes `EYES` apart. T frames,
S side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
import torch

from dfrf.cameras import Camera
from dfrf.method_interface import Maps, Method
from dfrf.workers import Workers
from dubbing.compositing import lip_colour
from dubbing.compositing.face_mask import lower_share
from dubbing.compositing.grade import graded_colours, measured, noticed
from dubbing.compositing.jaw_line import ANGLES, beside
from dubbing.face.face_contour import face_contour, face_region
from dubbing.face.mesh_points import LEFT_EYE_OUTER, RIGHT_EYE_OUTER
from dubbing.face.mouth.lip_region import lip_region
from dubbing.face.mouth.mouth_shape import INNER_LIP, OUTER_LIP
from dubbing.face.nose_region import nose_region
from dubbing.identity.dataset import lip_points, upper_face_expression
from dubbing.media import read_frames
from dubbing.preparation.covering import usual_colours
from dubbing.preparation.covering.light import shade
from dubbing.preparation.matting.matting import dilate
from dubbing.preparation.prepared import MATTE, PreparedClip
from dubbing.preparation.tracking import cropping

SIDE = 128  # px of the pictures that are rendered
EYES, W, H = 28.0, 88, 80  # of the frame of the face, px
EYES_AT = 8.0  # px below its upper edge
DARK = 12.0  # grey levels added before a logarithm is taken: noise of dark colours counts less
OPAQUE = 0.9  # opacity from which the head is compared
LIGHT = 9.0  # px, Gaussian: what varies more slowly is light
SHADE = 4.0  # px, Gaussian: the same of light that changes all channels alike
OUTLIER = 0.25  # of a logarithm: a place that far off says little about the light
LIPS = 0.04  # eye distances round the lips where words decide what is seen
RIM = 5  # px round the face that are rendered
MUCH, AWRY = 70, 0.1  # percent, logarithm: with so much beyond that, the head lies beside the face
AT_ONCE = 8
EYE_OUTERS = LEFT_EYE_OUTER, RIGHT_EYE_OUTER
OTHER_SKIN = 20.0  # of CIELAB: a lower face that differs more from the upper one is no skin
ZOOMED = 0.8  # of what the eyes' distance says: below 1 it is chance


@dataclass(frozen=True)
class Compared:
    """A frame in the frame of the face.

    Attributes:
        picture: (H, W, 3) uint8. apart: (H, W) float32, difference from the head as a logarithm.
        known: (H, W) bool, the lower face beside the lips. lips: (H, W) bool.
        face: (H, W) bool, all of the face beside the lips. nose: (H, W) bool.
        jaw: (K,) px of the crop, see `compositing.jaw_line.beside`.
        grade: (4,) of the film, see `compositing.grade.measured`.
        lip_colour: (3,) of the film, see `compositing.lip_colour.measured`.
        zoom: how much larger than one that looks ahead a turned face is here; 1 at least.
    """

    picture: np.ndarray
    apart: np.ndarray
    known: np.ndarray
    lips: np.ndarray
    face: np.ndarray
    nose: np.ndarray
    zoom: float = 1.0
    jaw: np.ndarray = field(default_factory=lambda: np.full(len(ANGLES), np.nan))
    grade: np.ndarray = field(default_factory=lambda: np.full(4, np.nan))
    lip_colour: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))


def to_face(landmarks: np.ndarray) -> np.ndarray:
    """The similarity (2, 3) float64 from px of a crop to the frame of the face."""
    return usual_colours.to_face(landmarks, EYES, W, EYES_AT).astype(np.float64)


def compare(
    image: np.ndarray,
    landmarks: np.ndarray,
    colour: np.ndarray,
    opacity: np.ndarray,
    haze: np.ndarray,
) -> Compared:
    """A frame beside the head.

    Args:
        image: (S, S, 3) uint8. landmarks: (478, 2) px of it.
        colour, opacity: of the head, premultiplied, (s, s, 3) and (s, s), 0..1, of any size s.
        haze: (3,) grey levels of light over the image.
    """
    turn, size = to_face(landmarks), len(image)

    def upright(pixels: np.ndarray) -> np.ndarray:
        scale = len(pixels) / size
        own = turn.copy()
        own[:, 2] += own[:, :2] @ np.full(2, 0.5 / scale - 0.5)
        own[:, :2] /= scale
        return np.asarray(cv2.warpAffine(pixels, own, (W, H), flags=cv2.INTER_LINEAR))

    small = cv2.resize(image, (len(opacity),) * 2, interpolation=cv2.INTER_AREA)
    picture, alpha = upright(small), upright(opacity)
    head = np.clip(255 * upright(colour) / np.maximum(alpha, 0.05)[..., None], 0, 255)
    points = landmarks @ turn[:, :2].T + turn[:, 2]
    side = max(W, H)
    face = face_region(points, side)[:H, :W] > 0
    lower = lower_share(points, (slice(0, H), slice(0, W))) > 0
    lips = dilate(lip_region(points, side)[:H, :W], LIPS * EYES)
    solid = (alpha > OPAQUE) & face
    grade = measured(np.maximum(picture - haze, 0), head, solid)
    bare = solid & ~lips
    if _tint(picture, head, bare & lower, bare & ~lower) > OTHER_SKIN:
        # What a mask over mouth and chin does to colours is no grade, and no light.
        grade, bare = np.full(4, np.nan), bare & ~lower
    head = graded_colours(head, noticed(grade))
    ratio = np.log(picture + DARK) - np.log(head + DARK)
    middle = np.median(ratio[bare], 0) if bare.any() else np.zeros(3)
    weight = (solid & ~lips) / (1 + (np.abs(ratio - middle).max(-1) / OUTLIER) ** 4)
    light, around = (
        cv2.GaussianBlur(x.astype(np.float32), (0, 0), LIGHT)
        for x in (weight[..., None] * (ratio - middle), weight)
    )
    rest = ratio - middle - light / (around[..., None] + 0.02)
    rest -= shade(rest, solid & ~lips, SHADE)
    apart = (np.abs(rest).max(-1) * solid).astype(np.float32)
    beside = solid & ~lips
    seen = beside & lower, lips & lower, beside, nose_region(points, side)[:H, :W]
    of_lips = lip_colour.measured(rest * solid[..., None], points[[*OUTER_LIP, *INNER_LIP]])
    return Compared(picture, apart, *seen, grade=grade, lip_colour=of_lips)


def _tint(picture: np.ndarray, head: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """By how much more a and b of CIELAB differ between two places (H, W) bool than in a head."""
    if not one.any() or not other.any():
        return 0.0
    film, own = (
        np.subtract(*(np.median(lab[place, 1:], 0) for place in (one, other)))
        for image in (picture, head)
        for lab in [cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)]
    )
    return float(np.linalg.norm(film - own))


@dataclass(frozen=True)
class Comparison:
    """Renders the head of a clip's frames as it speaks there, and compares it with them."""

    method: Method[Any, Any]
    maps: Maps | None
    clip: PreparedClip

    def look(self, frames: np.ndarray) -> Iterator[Compared]:
        """Frames (F,), rising, one by one."""
        clip, device = self.clip, self.method.model.device
        expression = torch.from_numpy(upper_face_expression(clip)[frames]).float()
        c2w = torch.from_numpy(clip.c2w()[frames]).float().to(device)
        lips, eyes = lip_points(clip, frames), clip.eye_distances()
        heads = self.method.heads_with_lips(expression, lips, c2w[:, :, 3], self.maps)
        scale = SIDE / clip.size
        centre = (torch.from_numpy(clip.centre[frames]).float().to(device) + 0.5) * scale - 0.5

        def one(job: tuple[int, np.ndarray, np.ndarray]) -> Compared:
            number, image, matte = job
            landmarks = clip.landmarks[frames[number]]
            region = dilate(face_region((landmarks + 0.5) * scale - 0.5, SIDE) > 0, RIM)
            camera = Camera(c2w[number], float(clip.focal) * scale, centre[number], SIDE)
            seen = heads(number).render(camera, torch.from_numpy(region).to(device))
            colour, opacity = (part.float().cpu().numpy() for part in seen)
            compared = compare(image, landmarks, colour, opacity, clip.haze[frames[number]])
            jaw = beside(
                cv2.resize(matte, (SIDE, SIDE), interpolation=cv2.INTER_AREA),
                (opacity * 255).round().astype(np.uint8),
                face_contour((landmarks + 0.5) * scale - 0.5, SIDE),
            )
            across = np.linalg.norm(np.diff(landmarks[list(EYE_OUTERS)], axis=0))
            zoom = ZOOMED * eyes[frames[number]] / max(float(across), 1.0)
            return replace(compared, zoom=max(1.0, float(zoom)), jaw=jaw / scale)

        with Workers(device, AT_ONCE) as workers:
            pictures = images(clip, frames), mattes(clip, frames)
            yield from workers.map(one, zip(range(len(frames)), *pictures, strict=True))


def images(clip: PreparedClip, frames: np.ndarray) -> Iterator[np.ndarray]:
    """Crops (S, S, 3) of frames (F,), rising."""
    if not len(frames):
        return
    first, wanted = int(frames[0]), set(frames.tolist())
    films = read_frames(clip.clip, start=first, count=int(frames[-1]) - first + 1, rate=clip.rate)
    for t, whole in enumerate(films, first):
        if t in wanted:
            yield cropping.crop(whole, clip.crop[t], clip.size)


def mattes(clip: PreparedClip, frames: np.ndarray) -> Iterator[np.ndarray]:
    """Mattes (S, S) of frames (F,), rising."""
    if not len(frames):
        return
    first, wanted = int(frames[0]), set(frames.tolist())
    file, count = clip.folder / MATTE, int(frames[-1]) - first + 1
    for t, matte in enumerate(clip.own_frames(file, first, count, "gray"), first):
        if t in wanted:
            yield matte


def usual_difference(apart: np.ndarray) -> np.ndarray:
    """By how much places differ in most of the frames (F, H, W), and those beside them, (H, W)."""
    middle = np.median(apart, 0)
    return np.asarray(cv2.dilate(middle, np.ones((3, 3))))


def is_awry(compared: Compared, usual: np.ndarray) -> bool:
    """Whether the head does not lie on the face: much of the face differs from it a little."""
    return off_by(compared, usual) > AWRY


def off_by(compared: Compared, usual: np.ndarray) -> float:
    """How far the face differs from the head, a logarithm beyond what is usual (H, W)."""
    if not compared.face.any():
        return 0.0
    return float(np.percentile(compared.apart[compared.face] - usual[compared.face], MUCH))
