"""Masks of captions, graphics or a microphone that lie over a part of the lower face.

Inside the outline of the face, colours that are far from usual ones are detected. Detections give
the colours and the rows of the graphic. In frames around a detection all pixels of these colours
and rows are masked, also on the neck. T frames, S side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from skimage.morphology import remove_small_objects

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import NOSE_BASE
from dubbing.face.mouth.lip_region import lip_region
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.media import MediaInfo, VideoWriter
from dubbing.preparation.covering.graphic import (
    LIPS,
    Detection,
    main_colours,
    mouth,
    outline,
    over_face,
    without_holes,
    ycc,
)
from dubbing.preparation.covering.letters import beside, veils
from dubbing.preparation.covering.occlusion import regions
from dubbing.preparation.covering.still_graphics import StillGraphics
from dubbing.preparation.covering.usual_colours import (
    EYES,
    UsualColours,
    eye_distance,
    in_usual_light,
    inside_face,
    rgb_of,
    to_face,
    upright,
)
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.matting.matting import dilate
from dubbing.preparation.tracking.detection import Arrays

FRAMES = 150  # from which usual colours are taken
EVERY = 2  # frames from one in which detections are made to the next
BEYOND = 25.0  # levels from usual colours
LEAST_AREA = 0.002  # of the squared eye distance, in one piece; 0 on clips without graphics
DARKEST = 0.25  # gain of the light: below, noise is as strong as colours
NEAR = 40.0  # levels between colours of one graphic, at most this share
SHARPER = 0.6  # of its distance from skin
LEAST_SHARE = 0.2  # of a detection's pixels that are not of a skin colour
AROUND = 100  # frames before and after a detection in which the graphic may be visible
LINE = 0.3  # eye distances that the rows of a graphic extend beyond its detections
OUTLINE = 0.07  # eye distances round its colours: outlines and shadows of letters
EVEN = 0.65  # share of its colours in the pixels round one of an even surface
AROUND_EVEN = np.ones((3, 3), np.uint8)  # round it: its edge, blurred by an encoder


class Overlay:
    """Detects things over a face in the crops of a clip.

    Args:
        crops: (T, S, S, 3) RGB. points: (T, P, 2 or more) px. valid, segment: (T,).
        shape: (P, 3) in the head frame. light: gain and offset (T, 3).
    """

    def __init__(
        self,
        crops: np.ndarray,
        points: np.ndarray,
        valid: np.ndarray,
        segment: np.ndarray,
        shape: np.ndarray,
        light: Arrays,
    ) -> None:
        self.crops, self.points, self.segment = crops, points, segment
        self.gain, self.offset = light["gain"], light["offset"]
        self.usable = valid & (self.gain.min(1) > DARKEST)
        self.skin = regions(shape)[1]
        self.usual = self._usual() if self.usable.any() else None

    def _colours(self, t: int, image: np.ndarray) -> np.ndarray:
        return in_usual_light(image, self.gain[t], self.offset[t])

    def _unlit(self, t: int, colours: np.ndarray) -> np.ndarray:
        """Colours (N, 3) Y, Cr, Cb of a frame, in the usual light."""
        return self._colours(t, rgb_of(colours[None])[0])

    def _usual(self) -> UsualColours:
        """Usual colours, from frames spread over the clip."""
        index = np.flatnonzero(self.usable)
        some = index[np.unique(np.linspace(0, len(index) - 1, FRAMES).round().astype(int))]

        def look(t: int) -> tuple[np.ndarray, ...]:
            at = self.points[t][:, :2].round().astype(int).clip(0, len(self.crops[t]) - 1)
            parts = [self.crops[t][at[which, 1], at[which, 0]] for which in (self.skin, OUTER_LIP)]
            images = (upright(self.crops[t], self.points[t]), *parts)
            return tuple(self._colours(t, image) for image in images)

        faces, skin, lips = zip(*in_order(look, ((int(t),) for t in some)), strict=True)
        return UsualColours.of(faces, np.concatenate(skin), np.concatenate(lips))

    def detections(self, progress: ReportShare) -> list[Detection]:
        """Frames in which something lies over the face, of one in so many (`EVERY`)."""

        def look(t: int) -> Detection | None:
            return self._detect(t, self.usual) if self.usual and self.usable[t] else None

        detections, some = [], range(0, len(self.crops), EVERY)
        for detection in in_order(look, ((t,) for t in some)):
            detections.append(detection)
            progress(len(detections) / len(some))
        return [detection for detection in detections if detection is not None]

    def _detect(self, t: int, usual: UsualColours) -> Detection | None:
        turn = to_face(self.points[t])
        points = self.points[t][:, :2] @ turn[:, :2].T + turn[:, 2]
        image = upright(self.crops[t], self.points[t])
        inside, lips = inside_face(points), mouth(points, EYES, image.shape[:2])
        bare = inside & ~lips
        lit = usual.evenly_lit(self._colours(t, image), bare)
        beyond = (usual.beyond(lit, inside) > BEYOND) & bare
        beyond[: max(0, round(float(points[NOSE_BASE, 1])))] = False
        unusual = large(beyond, EYES)
        if not unusual.any():
            return None
        colours = ycc(image[unusual])
        other = usual.from_skin(lit[unusual]) > 0
        if other.mean() < LEAST_SHARE:
            return None
        place = np.argwhere(unusual)[:, ::-1] - turn[:, 2]
        rows = place @ turn[:, 1] / float(turn[0, :2] @ turn[0, :2])  # the inverse similarity
        touching = bool((cv2.dilate(lips.astype(np.uint8), np.ones((3, 3))) > 0)[unusual].any())
        return Detection(t, int(rows.min()), int(rows.max()) + 1, colours[other], touching)

    def masks(self, detections: Sequence[Detection]) -> Iterator[np.ndarray]:
        """Mask (S, S) uint8 of every frame: 255 where something lies over the face, else 0."""

        def look(t: int, near: list[Detection], colours: np.ndarray) -> np.ndarray:
            if self.usual is None or not near or not self.usable[t]:
                return np.zeros(self.crops[t].shape[:2], np.uint8)
            return self._mask(t, near, colours, self.usual)

        def jobs() -> Iterator[tuple[int, list[Detection], np.ndarray]]:
            frames = np.array([detection.frame for detection in detections], int)
            for t in range(len(self.crops)):
                close = np.abs(frames - t) <= AROUND
                near = [detections[k] for k in np.flatnonzero(close).tolist()]
                near = [
                    detection
                    for detection in near
                    if self.segment[detection.frame] == self.segment[t]
                ]
                yield t, near, main_colours(near)

        yield from in_order(look, jobs())

    def _mask(
        self, t: int, near: list[Detection], colours: np.ndarray, usual: UsualColours
    ) -> np.ndarray:
        points, image = self.points[t], self.crops[t]
        size, eyes = len(image), eye_distance(points)
        line = round(LINE * eyes)
        top = max(0, min(detection.top for detection in near) - line)
        bottom = min(size, max(detection.bottom for detection in near) + line)
        rows = ycc(image[top:bottom])
        mask, exact = (np.zeros((size, size), np.uint8) for _ in range(2))
        for colour in colours:
            reach = min(NEAR, SHARPER * float(usual.from_skin(self._unlit(t, colour[None]))[0]))
            away = np.linalg.norm(rows - colour, axis=-1)
            mask[top:bottom] |= away < reach
            exact[top:bottom] |= away < reach / 2
        near_face, settled, bare, odd = self._places(t, usual)
        mask[~near_face] = 0
        mask[settled & ~over_face(exact, points)] = 0
        if not any(detection.at_mouth for detection in near if abs(detection.frame - t) < EVERY):
            lips = mouth(points, eyes, (size, size)).astype(np.uint8)
            mask[(lips > 0) & (beside(mask, lips) == 0)] = 0
        reach = max(2, round(OUTLINE * eyes))
        round_ = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, round_)
        # Of a lip or a glint a few pixels have a graphic's colour, too.
        closed = without_holes(large(closed > 0, eyes).astype(np.uint8))
        # An even surface ends where it ends; letters have outlines and shadows.
        dense = cv2.blur(mask.astype(np.float32), (4 * reach + 1,) * 2) > EVEN
        even = cv2.morphologyEx(np.where(dense, closed, 0), cv2.MORPH_OPEN, round_)
        even = np.maximum(even, veils(image, closed))
        around = cv2.dilate(even, round_)  # at its edge, fewer pixels have its colours
        even = np.maximum(even, np.where(around, closed, 0))
        letters = np.where(around, 0, closed)
        wide = cv2.dilate(letters, round_)
        lips = dilate(lip_region(points[:, :2], size), LIPS * eyes)
        if (lips & (wide > 0)).any():  # between letters there, and beside them, are film's lips
            fine = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, AROUND_EVEN) & letters
            narrow = dilate(fine > 0, outline(fine, bare, odd, reach))
            wide = np.where(lips, narrow, wide)
        return np.asarray(np.maximum(wide, cv2.dilate(even, AROUND_EVEN)) * 255)

    def _places(self, t: int, usual: UsualColours) -> list[np.ndarray]:
        """Pixels (S, S) bool whose usual colours are known, and of these those that never change.

        Then the face beside the mouth, and what of it has unusual colours.
        """
        points, size = self.points[t], len(self.crops[t])
        turn = to_face(points)
        upright_points = points[:, :2] @ turn[:, :2].T + turn[:, 2]
        inside = inside_face(upright_points)
        colours = self._colours(t, upright(self.crops[t], points))
        bare = inside & ~mouth(upright_points, EYES, inside.shape)
        odd = bare & (usual.beyond(usual.evenly_lit(colours, bare), inside) > BEYOND / 2)
        found = np.ones_like(inside), usual.settled(colours, inside), bare, odd
        back = cv2.invertAffineTransform(turn)
        return [
            cv2.warpAffine(one.astype(np.uint8), back, (size, size), flags=cv2.INTER_NEAREST) > 0
            for one in found
        ]


def large(mask: np.ndarray, eyes: float) -> np.ndarray:
    """A mask (S, S) bool without small pieces. eyes: distance of the outer corners of the eyes."""
    return np.asarray(remove_small_objects(mask, max_size=LEAST_AREA * eyes**2, connectivity=2))


def overlay_step(
    overlay: Overlay, graphics: StillGraphics, out: Path, info: MediaInfo, progress: ReportShare
) -> Arrays:
    """Write OUT: a mask of every frame, or a single empty one if nothing lies over the face.

    Args:
        graphics: of the same clip.

    Returns:
        over (T,) bool: frames whose mask is not empty.
    """
    detections = overlay.detections(lambda share: progress(share / 2))
    graphics.find(lambda share: progress((1 + share) / 2))
    over, size = np.zeros(len(overlay.crops), bool), overlay.crops.shape[1]
    with VideoWriter(out, size, size, info.rate, "ffv1-gray") as video:
        if not (detections or graphics.found):
            video.write(np.zeros((size, size), np.uint8))
            return {"over": over}
        for t, mask in enumerate(overlay.masks(detections)):
            whole = np.maximum(mask, graphics.mask(t))
            video.write(whole)
            over[t] = whole.any()
    return {"over": over}
