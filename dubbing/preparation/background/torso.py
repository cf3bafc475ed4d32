"""The torso behind the head.

A jaw that covers a part of the torso in one frame uncovers it in another. The frames of a shot are
aligned to one of them by the motion of the clothes. The median of the visible pixels is the torso's
plate: it gives collar and neck behind the jaw, as far up as any frame showed them.

S is the side of the crop in px, K frames of a shot. Lengths are for S = 512 and scale with it.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from dubbing.preparation.background.filling import pull_push
from dubbing.preparation.background.pixels import chosen, extent, known_median, rounded, spread
from dubbing.preparation.background.wall import halved
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

PERSON = 0.5  # of the person mask: above this a pixel is torso, where the head is not
MOST_CORNERS, CORNER_QUALITY, CORNER_GAP = 200, 0.005, 5.0
LEAST_CORNERS = 20
PATCH, LEVELS = 41, 4  # px and pyramid levels of the Lucas-Kanade tracker
SMALL_PATCH, SMALL_LEVELS = 21, 3  # of images of half the size
THERE_AND_BACK = 0.7  # px, largest error of a corner tracked forwards and back
OUTLIER = 1.5  # px
CLEAR = 4.0  # px round an inpaint mask that may still show the jaw
CLOTHES_PX = 90.0  # round the head within which clothes are tracked: beyond, they move otherwise
LEAST_SEEN = 0.3  # share of the frames in which a point must be visible,
AGREED_SEEN, AGREED = 0.1, 8.0  # or this one, if they differ by fewer grey levels in the median
LEAST_FOUND = 0.9  # share of the frames in which the torso must be tracked
BESIDE = 32.0  # px round the filled part within which torso and frame are compared
# Of a logarithm from the median there: what is further apart is no light, as where a collar lies
# beside the skin that the torso shows. Grey levels are added first, as noise of black is no light.
OTHER, DARK = 0.5, 16.0
EVEN = 4.0  # px along which the upper end of the filled part is smoothed


@dataclass(frozen=True)
class Torso:
    """The torso of a shot, aligned to its reference frame.

    Attributes:
        colour: (S, S, 3) uint8.
        share: (S, S) float32 in 0..1, share of a pixel that is person and not wall.
        visible: (S, S) bool, whether enough frames showed it.
        reference: (S / 2, S / 2) uint8 grey levels of the reference frame.
        corners: (P, 1, 2) float32 px of it that are tracked.
    """

    colour: np.ndarray
    share: np.ndarray
    visible: np.ndarray
    reference: np.ndarray
    corners: np.ndarray

    def motion(self, image: np.ndarray) -> np.ndarray | None:
        """Similarity (2, 3) that aligns the torso to an image (S, S, 3), None if not tracked."""
        grey = halved(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        motion = follow(self.reference, grey, self.corners, SMALL_PATCH, SMALL_LEVELS)
        if motion is None:
            return None
        turn, shift = motion[:, :2], motion[:, 2]
        return np.column_stack((turn, 2 * shift + 0.5 - 0.5 * turn.sum(1)))

    def fill(
        self,
        image: np.ndarray,
        region: np.ndarray,
        wall: np.ndarray,
        motion: np.ndarray,
        box: tuple[slice, slice],
    ) -> tuple[np.ndarray, np.ndarray]:
        """A part of the image with the torso in the inpaint mask, and the rest of the mask.

        Args:
            image: (S, S, 3) uint8, a frame of the shot. region: (S, S) bool, its inpaint mask.
            wall: (H, W, 3) float32, behind the torso in the part.
            motion: (2, 3) that aligns the torso to the image.
            box: rows and columns of the part, which holds all of the region.
        """
        part, left, unit = image[box].copy(), region[box], len(image) / REFERENCE_SIZE
        visible, share = self._seen(_shifted(motion, box), left.shape)
        here = reached(left, visible, unit)
        if here.any():
            inner = extent(here, round(BESIDE * unit))
            film = part[inner]
            there = _shifted(_shifted(motion, box), inner)
            side = film.shape[1::-1]
            colour = cv2.warpAffine(self.colour, there, side, flags=cv2.INTER_CUBIC)
            # What is apart beside the mask goes on in it: the light of the frame, and no seam.
            beside = alike(film, colour, (~left & visible & (share > PERSON))[inner])
            colour = colour + pull_push(cv2.subtract(film, colour, dtype=cv2.CV_32F), beside)
            filled = wall[inner] + spread(share[inner]) * (colour - wall[inner])
            part[inner] = chosen(here[inner], rounded(filled), film)
        return part, left & ~here

    def _seen(self, motion: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Where a moved torso is visible, (H, W) bool, and its share of a pixel, (H, W)."""
        side = shape[1], shape[0]
        visible = cv2.warpAffine(self.visible.astype(np.uint8) * 255, motion, side) > 0.99 * 255
        return visible, cv2.warpAffine(self.share, motion, side)


def alike(film: np.ndarray, colour: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Known pixels (H, W) bool where a frame and the torso, (H, W, 3) uint8, show the same."""
    if not known.any():
        return known
    ratio = np.log((film[known] + DARK) / (colour[known] + DARK))
    out = known.copy()
    out[known] = np.abs(ratio - np.median(ratio, 0)).max(1) < OTHER
    return out


def bottom_of(region: np.ndarray) -> np.ndarray:
    """Lowest row (S,) of a region (S, S) bool in every column, -1 where it has none."""
    rows = len(region) - 1 - np.argmax(region[::-1], axis=0)
    return np.where(region.any(0), rows, -1)


def _shifted(motion: np.ndarray, box: tuple[slice, slice]) -> np.ndarray:
    """A similarity (2, 3) to px of the box, rows and columns, in an image."""
    out = motion.copy()
    out[:, 2] -= (box[1].start, box[0].start)
    return out


def reached(region: np.ndarray, visible: np.ndarray, unit: float) -> np.ndarray:
    """Pixels of an inpaint mask (H, W) that are visible from its lower end up without a gap.

    The upper end is smoothed.

    Args:
        unit: px of the crop for one at S = 512.
    """
    bottom = bottom_of(region)
    row = np.arange(len(region), dtype=np.int32)[:, None]
    gap = np.where(visible & region, -1, row)
    gap[row > bottom] = -1
    height = np.where(bottom >= 0, bottom - gap.max(0), 0).astype(np.float32)
    even = minimum_filter1d(height, 2 * round(EVEN * unit) + 1)
    even = np.minimum(gaussian_filter1d(even, EVEN * unit), height)
    return region & (bottom - row < even) & (row <= bottom)


def follow(
    reference: np.ndarray,
    grey: np.ndarray,
    corners: np.ndarray,
    patch: int = PATCH,
    levels: int = LEVELS,
) -> np.ndarray | None:
    """Similarity (2, 3) that maps the reference to a frame, both (S, S) uint8.

    Args:
        corners: (P, 1, 2) px in the reference. patch, levels: see `flow`.

    Returns:
        None where too few corners agree on one.
    """
    if len(corners) < LEAST_CORNERS:
        return None
    there, tracked = flow(reference, grey, corners, patch, levels)
    back, returned = flow(grey, reference, there, patch, levels)
    unit = len(grey) / REFERENCE_SIZE
    error = np.linalg.norm(back - corners, axis=-1)[:, 0]
    good = tracked & returned & (error < THERE_AND_BACK * unit)
    if good.sum() < LEAST_CORNERS:
        return None
    motion, inlier = cv2.estimateAffinePartial2D(
        corners[good], there[good], ransacReprojThreshold=OUTLIER * unit
    )
    if motion is None or inlier.sum() < max(LEAST_CORNERS, good.sum() / 3):
        return None
    return np.asarray(motion)


def flow(
    start: np.ndarray, end: np.ndarray, points: np.ndarray, patch: int, levels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 1, 2) px tracked into the next image by Lucas and Kanade, and which succeeded.

    Args:
        patch: px that are compared. levels: of the pyramid.
    """
    there, tracked, _ = cv2.calcOpticalFlowPyrLK(
        start, end, points, points.copy(), winSize=(patch, patch), maxLevel=levels
    )
    return np.asarray(there), np.asarray(tracked)[:, 0] > 0


def torso(images: np.ndarray, person: np.ndarray, inpaint_masks: np.ndarray) -> Torso | None:
    """The torso of a shot from some of its frames.

    Args:
        images: (K, S, S, 3), person: (K, S, S) person masks, both uint8.
        inpaint_masks: (K, S, S) bool, where the head is.

    Returns:
        None where the torso cannot be tracked.
    """
    size = images.shape[1]
    unit = size / REFERENCE_SIZE
    free = [~dilate(region, CLEAR * unit) for region in inpaint_masks]
    middle = len(images) // 2
    reference = cv2.cvtColor(images[middle], cv2.COLOR_RGB2GRAY)
    head = inpaint_masks[middle]
    beside = cv2.distanceTransform((~head).astype(np.uint8), cv2.DIST_L2, 5)  # px from the head
    near = (beside > PATCH / 4 * unit) & (beside <= CLOTHES_PX * unit)
    cloth = near & (person[middle] > PERSON * 255)
    corners = cv2.goodFeaturesToTrack(
        reference, MOST_CORNERS, CORNER_QUALITY, CORNER_GAP * unit, mask=cloth.astype(np.uint8)
    )
    if corners is None:
        return None
    colours, shares, views = [], [], []
    for image, mask, clear in zip(images, person, free, strict=True):
        motion = follow(reference, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), corners)
        if motion is None:
            continue
        back = cv2.invertAffineTransform(motion)
        colours.append(cv2.warpAffine(image, back, (size, size), flags=cv2.INTER_CUBIC))
        shares.append(cv2.warpAffine(mask, back, (size, size)))
        views.append(cv2.warpAffine(clear.astype(np.float32), back, (size, size)) > 0.99)
    if len(views) < LEAST_FOUND * len(images):
        return None
    visible = np.stack(views)
    colour = rounded(known_median(np.stack(colours), visible))
    same = [cv2.absdiff(one, colour).max(2) < AGREED for one in colours]
    often = visible.mean(0)
    agreed = (visible & same).mean(0) >= often / 2
    return Torso(
        colour=colour,
        share=known_median(np.stack(shares)[..., None], visible)[..., 0] / 255,
        visible=(often >= LEAST_SEEN) | ((often >= AGREED_SEEN) & agreed),
        reference=halved(reference),
        corners=(corners - np.float32(0.5)) / 2,
    )
