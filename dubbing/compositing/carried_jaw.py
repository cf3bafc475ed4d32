"""The film's own jaw, carried to where the new words move it.

A learned chin is smoother than the film's, and its outline lies a few pixels beside it, the more
the further a head turns. The film's frame shows that chin in its light, with its edge, only with
other words. So the outlines of both tell by how much the jaw moves, and the film's pixels are moved
by that. Within them the learned head is shown: the mouth, and what acts round it. S is the side of
the crop in px. Lengths are for S = 512 and scale with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dubbing.compositing.face_mask import (
    from_lips,
    jaw_share,
    pixels_of,
    round_mouth,
    skull_share,
)
from dubbing.compositing.jaw_line import ANGLES, radii
from dubbing.compositing.jaw_opening import comes_off, falling, moving_share, opening_way
from dubbing.face.face_contour import FaceContour
from dubbing.face.mouth.lip_region import lip_region
from dubbing.face.mouth.mouth_shape import OUTER_LIP
from dubbing.preparation.background.pixels import Part, rounded, spread
from dubbing.preparation.matting.matting import REFERENCE_SIZE

RAYS = np.arange(192) * (2 * np.pi / 192)  # from the middle of the face, as `ANGLES`
FURTHEST = 80.0  # px between outlines of one jaw
FEWEST = 12  # rays that must meet a jaw
EVEN = 1.5  # rays over which an outline's direction is smoothed
OBLIQUE = 0.2  # cosine between a ray and an outline's normal: the least that counts
TOLD = 0.05  # of the jaw's motion: points that move less tell nothing of it
STILL = 5.0  # px of an outline across its way that say as much as that a jaw stays where it is
LIPS = (8.0, 20.0)  # px from the lips between which the outline begins to be the jaw's
# The learned head is shown in full near the lips and away from the outline, px; below the middle of
# the lips, from this share of the face's height on, near them alone.
MOUTH, INSIDE, NEAR, BELOW = (18.0, 36.0), (5.0, 24.0), (14.0, 46.0), 0.06
# Px beyond face and learned head where a matte holds something else, and where it holds clothes
# that a chin touches.
BESIDE, CLOTHES = (14.0, 20.0), (0.0, 2.0)
RIM = (3.0, 6.0)  # px inside a matte's edge up to which it may hold clothes by error
PALE, SOFT = 0.05, 0.8  # how much lower their share of red is than the face's; px of their edge
VAGUE = 80.0  # grey levels, of all channels together, of the face's red that are added to a pixel
INPAINTED = (8.0, 20.0)  # px below what lies over a face, over which its continuation fades
HALF = 127  # of 255
STEP = 4.0  # px of a way


@dataclass(frozen=True)
class CarriedHead:
    """The film's head with a jaw that moved, in which the learned head is shown.

    Attributes:
        head: (S, S, 4) uint8, colour premultiplied by opacity, and opacity.
        share: (S, S) uint8, how much of each pixel may be another one than the film's.
        kept: (S, S) float32 0..1, how much of each pixel of the head is one of the film's.
    """

    head: np.ndarray
    share: np.ndarray
    kept: np.ndarray


@dataclass(frozen=True)
class FilmFace:
    """The face of a frame of the film, whose jaw can be moved.

    Attributes:
        image: (S, S, 3) uint8, inpainted where something lies over the face.
        matte: (S, S) uint8 of the head.
        overlay: (S, S) uint8, what lies over the face; None where nothing does.
        landmarks: (478, 2) px. contour: of these.
    """

    image: np.ndarray
    matte: np.ndarray
    overlay: np.ndarray | None
    landmarks: np.ndarray
    contour: FaceContour

    @property
    def unit(self) -> float:
        """Px of the crop for one at `REFERENCE_SIZE`."""
        return len(self.matte) / REFERENCE_SIZE

    def motion_to(self, head: np.ndarray, offsets: np.ndarray | None) -> np.ndarray:
        """By how much new words move the jaw from where the film has it, (2,) px.

        Of motions along `opening_way`, the one that brings the film's outline closest to the
        head's, measured across it. 0 where the picture does not tell.

        Args:
            head: (S, S) uint8, opacity of the learned head.
            offsets: (K,) px by which its outline is off; see `jaw_line.beside`.
        """
        unit, landmarks, contour = self.unit, self.landmarks, self.contour
        filmed, new = (radii(x, contour.middle, RAYS) for x in (self.matte, head))
        if offsets is not None:
            new = new + np.interp(RAYS, ANGLES, offsets, period=2 * np.pi)
        away = new - filmed
        ray = np.stack([np.cos(RAYS), np.sin(RAYS)], 1)
        points = contour.middle + np.nan_to_num(filmed)[:, None] * ray
        lips = np.linalg.norm(points[:, None] - landmarks[list(OUTER_LIP)], axis=2).min(1) / unit
        share = moving_share(landmarks, points[:, 0], points[:, 1])
        told = (jaw_share(contour, RAYS) > 0) & (share > TOLD) & (lips > LIPS[0])
        told &= np.abs(away) < FURTHEST * unit
        if self.overlay is not None:
            x, y = np.clip(points.round().astype(int), 0, len(head) - 1).T
            told &= self.overlay[y, x] == 0
        if told.sum() < FEWEST:
            return np.zeros(2)
        even = gaussian_filter1d(points, EVEN, axis=0, mode="wrap")
        along = (np.roll(even, -1, 0) - np.roll(even, 1, 0))[told] / 2
        length = np.maximum(np.linalg.norm(along, axis=1), 1e-6)
        across = np.stack([along[:, 1], -along[:, 0]], 1) / length[:, None]
        way = opening_way(landmarks)
        wanted = away[told] * np.clip((ray[told] * across).sum(1), OBLIQUE, 1)
        parts = share[told] * (across @ way)
        parts = np.where(np.abs(parts) < TOLD, np.copysign(TOLD, parts), parts)
        weight = length * np.clip((lips[told] - LIPS[0]) / (LIPS[1] - LIPS[0]), 0, 1)
        # The least sum of distances, which a weighted median of what each ray says gives. Of an
        # outline along the way rays say anything: then the jaw stays.
        said = np.append(wanted / parts, 0.0)
        weights = np.append(weight * np.abs(parts), STILL * unit)
        order = np.argsort(said)
        sums = weights[order].cumsum()
        return np.asarray(said[order[np.searchsorted(sums, sums[-1] / 2)]] * way)

    def carried(
        self,
        head: np.ndarray,
        share: np.ndarray,
        motion: np.ndarray,
        held: np.ndarray,
        neck: np.ndarray,
    ) -> CarriedHead:
        """The head with its jaw moved, and the learned head shown within it.

        Args:
            head: (S, S, 4) uint8, the learned one, colour premultiplied by opacity, and opacity.
            share: (S, S) uint8, how much of each pixel may be the learned head's.
            motion: (2,) px, see `motion_to`. held: (S,) share of each column that does not move.
            neck: (S,) share of each column that is neck below the jaw, of whatever red.
        """
        size, unit, landmarks = len(self.image), self.unit, self.landmarks
        out = cv2.merge((np.zeros_like(self.image), self.matte))
        changed, kept = np.zeros((size, size), np.uint8), np.zeros((size, size), np.float32)
        part = round_mouth(landmarks, size)
        if not self.matte[part].size:  # the mouth is outside of the picture
            return CarriedHead(out, changed, kept)
        x, y = pixels_of(part)
        moving = moving_share(landmarks, x, y) * (1 - held[part[1]])
        moving = moving.astype(np.float32)
        across, down = motion.astype(np.float32)
        places = x - across * moving, y - down * moving
        film = remapped(self.image, places, cv2.INTER_CUBIC)
        own, face = head[part], self.contour.region[part]
        learned = own[..., 3] > HALF
        new = learned | (remapped(face, places) > HALF)
        beyond = distance(~new) / unit
        opacity = remapped(self.matte, places) * falling(beyond, BESIDE)
        pale = of_another_red(film, (face > HALF) & learned & (moving > 0)).astype(np.float32)
        clothes = cv2.GaussianBlur(pale, (0, 0), max(SOFT, unit))
        rim = comes_off(landmarks) * falling(distance(opacity > HALF) / unit, RIM)
        opacity = opacity * (1 - clothes * np.maximum(rim, 1 - falling(beyond, CLOTHES)))
        shown = self._shown(part, opacity, own[..., 3], motion)
        if self.overlay is not None:
            # What lies over the film's jaw does not move with it. Deep below it nothing is known.
            deep = remapped(distance(self.overlay > 0), places) / unit
            shown = np.maximum(shown, 1 - falling(deep, INPAINTED))
        shown = (shown * share[part] / 255).astype(np.float32)
        kept[part] = (1 - shown) * opacity / 255
        both = spread(kept[part]) * film + spread(shown) * own[..., :3]
        out[part] = rounded(cv2.merge((both, 255 * kept[part] + shown * own[..., 3])))
        moved = np.clip(np.hypot(*motion) / unit * moving, 0, 1)
        # A matte's collar stays where it lies away from the jaw, here and where the film has it. So
        # does what the film shows beside its head, clothes or a wall, where no jaw covers it.
        heads = new | (face > HALF) | swept(learned, -motion)
        filmed = self.matte[part] > HALF
        beside = of_another_red(self.image[part], face > HALF) & ~filmed
        stays = cv2.GaussianBlur(beside.astype(np.float32), (0, 0), max(SOFT, unit))
        stays = np.maximum(
            stays * (1 - neck[part[1]]) * (1 - out[part][..., 3] / np.float32(255)),
            filmed * (1 - falling(distance(~heads) / unit, BESIDE)),
        )
        moved = moved * (1 - stays)
        changed[part] = (255 * np.maximum(moved, shown)).round()
        if self.overlay is not None:
            changed = np.minimum(changed, 255 - self.overlay)
        return CarriedHead(out, changed, kept)

    def _shown(
        self, part: Part, opacity: np.ndarray, learned: np.ndarray, motion: np.ndarray
    ) -> np.ndarray:
        """How much of each pixel is the learned head's, (H, W) 0..1, in rows and columns `part`.

        Args:
            opacity, learned: (H, W) 0..255, of the film's head, moved, and of the learned one.
        """
        size, unit, landmarks = len(self.image), self.unit, self.landmarks
        lips = distance(~swept(lip_region(landmarks, size)[part], motion)) / unit
        depth = np.minimum(*(distance(a > HALF) for a in (opacity, learned))) / unit
        below = np.clip(-from_lips(landmarks, *pixels_of(part))[0] / BELOW, 0, 1)
        inside = np.minimum(1 - falling(depth, INSIDE), 1 - below * (1 - falling(lips, NEAR)))
        # The outline of the nose, and of what is above the lips, is the film's.
        speaking = 1 - skull_share(landmarks, part)
        # Where a learned profile is dented beside the lips, there is the film's skin.
        solid = np.maximum(learned / np.float32(255), falling(lips, LIPS))
        shown: np.ndarray = np.maximum(inside, speaking * solid * falling(lips, MOUTH))
        return shown


def remapped(
    image: np.ndarray, places: tuple[np.ndarray, np.ndarray], how: int = cv2.INTER_LINEAR
) -> np.ndarray:
    """An image (S, S, ...) read at columns and rows (H, W), px; its edge beyond it."""
    return np.asarray(cv2.remap(image, *places, how, borderMode=cv2.BORDER_REPLICATE))


def of_another_red(image: np.ndarray, face: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool of an image (H, W, 3) uint8 that are less red than a face (H, W) bool.

    The darker a pixel, the less its colours say: below a chin, they are those of compression.
    """
    smooth = cv2.blur(image, (3, 3)).astype(np.float32) + 1
    light = cv2.transform(smooth, np.ones((1, 3)))
    usual = float(np.median((smooth[..., 0] / light)[face])) if face.any() else 0.0
    return np.asarray((smooth[..., 0] + VAGUE * usual) / (light + VAGUE) < usual - PALE)


def swept(region: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool that a region meets on its way."""
    one, size = region.astype(np.uint8), region.shape[::-1]
    steps = np.linspace(0, 1, 2 + math.ceil(np.hypot(*motion) / STEP))
    shifts = [np.array([[1, 0, x], [0, 1, y]]) for x, y in steps[:, None] * motion]
    met = [cv2.warpAffine(one, shift, size, flags=cv2.INTER_NEAREST) for shift in shifts]
    return np.asarray(np.max(met, axis=0) > 0)


def distance(region: np.ndarray) -> np.ndarray:
    """Px (H, W) float32 from each pixel of a region to its edge; 0 beyond it."""
    away = cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, 5)
    return np.minimum(away, np.float32(sum(region.shape)))  # a region without edge has no end
