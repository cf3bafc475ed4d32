"""Finds graphics that stand still in the film while a face moves under them.

A subtitle in a box, a logo that one sees through, a picture in the picture may have the colours of
skin, of shade or of a wall. But their edges stay where they are while the head moves, and those of
a face do not. T frames, S side of a crop in px; n frames are looked at, H x W px each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.engine.graph.stage import ReportShare
from dubbing.face.mesh_points import CHIN, FACE_OVAL, NOSE_BASE
from dubbing.face.mouth.lip_region import lip_region
from dubbing.preparation.covering.graphic import LIPS
from dubbing.preparation.covering.panels import panels_of
from dubbing.preparation.covering.still_edges import STRONG, Film, edges_of, moved, standing
from dubbing.preparation.covering.usual_colours import eye_distance, to_face
from dubbing.preparation.crops.threads import in_order
from dubbing.preparation.matting.matting import dilate

SPAN, APART, LOOKS = 25, 10, 8  # frames looked at together, from one such span to the next, of it
AROUND = 100  # frames before and after a span in which its graphic may be shown
EYES = 80.0  # px between the eyes of what is looked at, at most
LESS = 0.4  # of how much a place of the face changes that is followed
# Eye distances:
MOVED = 0.02  # deviation of the face's motion across an edge
LEAST = 0.09  # root of the area of all edges
ENOUGH = 0.7  # of it, at a glance
GROWN = 0.12  # from an edge that is sure to one of the same letter
LETTER = 0.06  # radius that closes a letter between its edges
INSIDE = 0.03  # from the outline of the face
ONE_WAY = 0.15  # of the edges of a letter, at least, lie along rows, and along columns
THERE = 0.5  # of a graphic's edges: with less of them in a frame it is not shown


@dataclass(frozen=True)
class StillGraphic:
    """Edges (H, W, 2, 2) of luma and chroma across and down; panels and letters (H, W) bool."""

    edges: np.ndarray
    panels: np.ndarray
    letters: np.ndarray

    def is_in(self, edges: np.ndarray) -> bool:
        """Whether a frame with these edges shows it."""
        where = self.panels | self.letters
        own, seen = self.edges[where], edges[where]
        return bool((own * seen).sum() > THERE * (own * own).sum())


def still_graphic(film: Film, frames: Sequence[int]) -> StillGraphic | None:
    """What stands still over the face in some frames of a shot, in the window of the middle one."""
    of = frames[len(frames) // 2]
    points = np.stack([film.at(t, of) for t in frames])
    eyes = float(np.median([eye_distance(at) for at in points]))
    turns = [to_face(at) for at in points]
    home = _whole(to_face(points[len(frames) // 2]))
    inside = _inside(points, (film.side, film.side), eyes)
    rows, columns = (np.flatnonzero(inside.any(axis)) for axis in (1, 0))
    if not len(rows):
        return None
    part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    middle = points[:, [CHIN, NOSE_BASE]].mean((0, 1))
    ways = np.stack([home[:2, :2].T @ (_whole(t) @ (*middle, 1))[:2] for t in turns])
    ways = (ways - ways.mean(0)) / np.linalg.norm(home[0, :2]) ** 2
    seen, _, some = standing(np.stack([edges_of(film.glance(t, of, part)) for t in frames]))
    some &= inside[part] & _is_crossed(_across(seen), ways, eyes)
    if some.sum() < ENOUGH * (LEAST * eyes) ** 2:  # most spans end here
        return None
    looks = [film.look(t, of) for t in frames]
    mean, change, still = standing(np.stack([edges_of(image) for image in looks]))
    size = still.shape[::-1]
    followed = [
        edges_of(cv2.warpAffine(image, (np.linalg.inv(home) @ _whole(turn))[:2], size))
        for image, turn in zip(looks, turns, strict=True)
    ]
    changes = standing(np.stack(followed))[1]
    calmer = cv2.blur(change, (3, 3)) < LESS * cv2.blur(changes, (3, 3))
    across = _across(mean)
    sure = still & inside & calmer & _is_crossed(across, ways, eyes)
    if sure.sum() < (LEAST * eyes) ** 2:
        return None
    nose = points[:, NOSE_BASE].mean(0)
    down = np.abs(across[..., 1]) > np.abs(across[..., 0])
    known = sure | (still & ~inside)
    level, upright = known & down, known & ~down
    panels = panels_of(level, upright, sure & down, nose[1], eyes)
    panels |= panels_of(upright.T, level.T, (sure & ~down).T, nose[0], eyes).T
    free = cv2.dilate(panels.astype(np.uint8), np.ones((9, 9))) == 0  # px: of its edge
    image = np.mean(looks, 0).astype(np.float32)
    letters = _letters(still & free & (calmer | ~inside), sure & free, down, image, eyes)
    if not (panels | letters).any():
        return None
    return StillGraphic(mean, panels, letters)


def _across(edges: np.ndarray) -> np.ndarray:
    """Directions (H, W, 2) of unit length across edges (H, W, 2, 2), by the stronger channel."""
    strongest = np.abs(edges).sum(3).argmax(2)[..., None, None].repeat(2, 3)
    across = np.take_along_axis(edges, strongest, 2)[:, :, 0]
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=2), 1e-6)[..., None])


def _is_crossed(across: np.ndarray, ways: np.ndarray, eyes: float) -> np.ndarray:
    """Edges (H, W) bool, by their directions (H, W, 2), that the face moves across by ways (n, 2).

    Where it moves along an edge of its own, that edge stays, too.
    """
    crossed: np.ndarray = ((across @ ways.T) ** 2).mean(2) > (MOVED * eyes) ** 2
    return crossed


def _whole(turn: np.ndarray) -> np.ndarray:
    return np.vstack([turn, (0, 0, 1)]).astype(np.float64)


def _inside(points: np.ndarray, shape: tuple[int, ...], eyes: float) -> np.ndarray:
    """Pixels (H, W) bool that are of the lower face in all frames; points (n, P, 2)."""
    everywhere = np.ones(shape, np.uint8)
    for at in points:
        face = np.zeros(shape, np.uint8)
        cv2.fillPoly(face, [at[list(FACE_OVAL)].round().astype(np.int32)], 1)
        everywhere &= face
    inside = cv2.erode(everywhere, np.ones((2 * round(INSIDE * eyes) + 1,) * 2)) > 0
    inside[: max(0, int(points[:, NOSE_BASE, 1].max()))] = False
    return np.asarray(inside)


def _letters(
    still: np.ndarray, sure: np.ndarray, down: np.ndarray, image: np.ndarray, eyes: float
) -> np.ndarray:
    """Letters (H, W) bool between edges, of which some are sure, in the mean image (H, W, 3).

    They are brighter or darker than what lies round them, and have edges of all directions.

    Args:
        down: edges that lie along rows.
    """
    near = cv2.distanceTransform((~sure).astype(np.uint8), cv2.DIST_L2, 3) < GROWN * eyes
    _, piece = cv2.connectedComponents(cv2.dilate((still & near).astype(np.uint8), np.ones((3, 3))))
    own = np.isin(piece, np.unique(piece[sure])) & (piece > 0)
    if not sure.any() or not ONE_WAY < down[sure].mean() < 1 - ONE_WAY:
        return np.zeros_like(sure)
    reach = 2 * round(LETTER * eyes) + 1
    round_ = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    closed = cv2.morphologyEx(own.astype(np.uint8), cv2.MORPH_CLOSE, round_) > 0
    wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach - 1, 2 * reach - 1))
    luma = cv2.cvtColor(image / 255, cv2.COLOR_RGB2GRAY) * 255
    hats = [cv2.morphologyEx(luma, kind, wide) for kind in (cv2.MORPH_TOPHAT, cv2.MORPH_BLACKHAT)]
    strokes = max((closed & (hat > STRONG) for hat in hats), key=np.sum).astype(np.uint8)
    return np.asarray(cv2.dilate(strokes, np.ones((3, 3))) > 0)


class StillGraphics:
    """The graphics of a clip that stand still over a face.

    Args:
        crops: (T, S, S, 3) RGB. points: (T, P, 2 or more) px. window: (T, 4), see `cropping`.
        valid, segment: (T,) whether the face is known, and the number of the shot.
    """

    def __init__(
        self,
        crops: np.ndarray,
        points: np.ndarray,
        window: np.ndarray,
        valid: np.ndarray,
        segment: np.ndarray,
    ) -> None:
        eyes = np.median([eye_distance(points[t]) for t in np.flatnonzero(valid)] or [EYES])
        self.film = Film(crops, points, window, min(1.0, EYES / max(1.0, float(eyes))))
        self.valid, self.segment = valid, segment
        self.found: list[tuple[int, StillGraphic]] = []

    def find(self, progress: ReportShare) -> None:
        """Looks at all spans of all shots."""
        spans = self._spans()
        graphics = in_order(lambda span: still_graphic(self.film, span), ((s,) for s in spans))
        for number, (span, graphic) in enumerate(zip(spans, graphics, strict=True), 1):
            if graphic is not None:
                self.found.append((span[len(span) // 2], graphic))
            progress(number / len(spans))

    def _spans(self) -> list[list[int]]:
        """Frames that are looked at together, of one shot each."""
        spans = []
        for shot in np.unique(self.segment[self.valid]):
            frames = np.flatnonzero(self.valid & (self.segment == shot))
            for first in range(0, max(1, len(frames) - SPAN + APART), APART):
                part = frames[first : first + SPAN]
                if len(part) >= LOOKS:
                    some = np.linspace(0, len(part) - 1, LOOKS).round().astype(int)
                    spans.append(part[some].tolist())
        return spans

    def mask(self, t: int) -> np.ndarray:
        """Mask (S, S) uint8 of a frame: 255 where a graphic lies that it shows."""
        size = len(self.film.crops[t])
        mask = np.zeros((size, size), np.uint8)
        if not (self.found and self.valid[t]):
            return mask
        points = self.film.points[t][:, :2]
        # Of a letter that one sees through, the film's lips would stay.
        lips = dilate(lip_region(points, size), LIPS * eye_distance(points)).astype(np.uint8)
        near = [
            (of, graphic)
            for of, graphic in self.found
            if abs(of - t) <= AROUND and self.segment[of] == self.segment[t]
        ]
        seen: dict[bytes, np.ndarray] = {}  # edges of the frame, by how its window lies
        for of, graphic in near:
            way = self.film.move(t, of).tobytes()
            if way not in seen:
                seen[way] = edges_of(self.film.look(t, of))
            if graphic.is_in(seen[way]):
                panels, letters = (
                    moved(cv2.resize(part.astype(np.uint8), (size, size)), self.film.move(of, t))
                    for part in (graphic.panels, graphic.letters)
                )
                mask |= panels | (letters & ~lips)
        return mask * 255
