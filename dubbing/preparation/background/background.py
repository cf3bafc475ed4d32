"""What lies behind the head: a plate of each shot, and a neck that goes on under the chin.

S is the side of the crop in px, T frames. The head's own pixels are never used: the plate is made
of pixels where no person is, the neck of pixels below the inpaint mask.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from dubbing.face.mesh_points import LEFT_EAR, RIGHT_EAR
from dubbing.preparation.background.known_median import known_median
from dubbing.preparation.background.pull_push import pull_push
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

PERSON_LEAST = 0.1  # of the person mask: below this a pixel belongs to the background
PERSON_MARGIN = 9  # px at S = 512
PLATE_FRAMES = 40
COARSE = 8  # the slow difference of frame and plate is computed this much smaller
PROFILE = 96  # samples across the neck, over PROFILE_SPAN face widths to both sides
PROFILE_SPAN = 1.0
PROFILE_DEPTH = 8  # px at S = 512 below the inpaint mask that are averaged
NECK_HEIGHT = 0.38  # face widths
NECK_HALF_WIDTH = 0.22  # face widths: further out the neck ends, what is there is a collar
NECK_ROUNDING = 0.2  # face widths over which its height falls to nothing
NECK_DARKENING = 0.12  # at its upper end, under the chin's shadow
SEAM_ROWS = 3  # px below the inpaint mask whose colour the seam takes
SEAM_DEPTH = 10.0  # px at S = 512 over which it goes over into the smoothed colour
RIM_FULL, RIM_END = 5.0, 10.0  # px at S = 512 inside the mask: what lies beside it fades out
MEDIAN_FRAMES, SMOOTH_FRAMES = 9, 4.0


def background_pixels(person: np.ndarray) -> np.ndarray:
    """Where surely no person is: (S, S) bool from the person mask (S, S) float."""
    return ~dilate(person > PERSON_LEAST, PERSON_MARGIN * len(person) / REFERENCE_SIZE)


def plate(images: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Background (H, W, 3) float32: temporal median of known pixels, pull-push elsewhere.

    Args:
        images: (K, H, W, 3) uint8, one camera. known: (K, H, W) bool.
    """
    seen = np.any(known, axis=0).astype(np.float32)
    return pull_push(known_median(images, known), np.asarray(seen))


@dataclass(frozen=True)
class NeckFrame:
    """Where the neck profile of a frame is sampled: middle and width of the face in px."""

    middle: float
    width: float

    @staticmethod
    def of(landmarks: np.ndarray) -> NeckFrame:
        """From landmarks (478, 2) px."""
        left, right = landmarks[LEFT_EAR], landmarks[RIGHT_EAR]
        return NeckFrame(float(left[0] + right[0]) / 2, float(np.hypot(*(right - left))))

    def columns(self) -> np.ndarray:
        """Columns (PROFILE,) px of the samples."""
        return self.middle + np.linspace(-PROFILE_SPAN, PROFILE_SPAN, PROFILE) * self.width

    def position(self, size: int) -> np.ndarray:
        """Sample numbers (S,), with fractions, of all columns of the crop."""
        return ((np.arange(size) - self.middle) / self.width / PROFILE_SPAN + 1) * (PROFILE - 1) / 2


def bottom_of(region: np.ndarray) -> np.ndarray:
    """Lowest row (S,) of a region (S, S) bool in every column, -1 where it has none."""
    rows = len(region) - 1 - np.argmax(region[::-1], axis=0)
    return np.where(region.any(0), rows, -1)


def neck_profile(
    image: np.ndarray, person: np.ndarray, region: np.ndarray, landmarks: np.ndarray
) -> np.ndarray:
    """Colour and share of the person just below the inpaint mask: (PROFILE, 4), NaN where unknown.

    Columns 0..2 are RGB in grey levels, column 3 how much of it is person, 0..1.
    """
    size = len(image)
    bottom = bottom_of(region)
    depth = max(2, round(PROFILE_DEPTH * size / REFERENCE_SIZE))
    rows = np.clip(bottom + 1 + np.arange(depth)[:, None], 0, size - 1)
    columns = np.arange(size)[None]
    colour, share = image[rows, columns].astype(np.float32), person[rows, columns]
    weight = share + 1e-6
    mean = (colour * weight[..., None]).sum(0) / weight.sum(0)[:, None]
    values = np.concatenate((mean, share.mean(0)[:, None]), axis=1)
    values[(bottom < 0) | (bottom + depth >= size)] = np.nan
    at = NeckFrame.of(landmarks).columns()
    known = np.isfinite(values[:, 0])
    out = np.full((PROFILE, 4), np.nan, np.float32)
    inside = (at >= 0) & (at <= size - 1) & known[np.clip(at.round().astype(int), 0, size - 1)]
    if known.any():
        for k in range(4):
            out[inside, k] = np.interp(at[inside], np.flatnonzero(known), values[known, k])
    return out


def smooth_profiles(profiles: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Profiles (T, PROFILE, 4) without gaps and without flicker, shot by shot.

    Gaps take the nearest known sample across, then in time; samples never known have share 0.
    """
    out = profiles.copy()
    for t in range(len(out)):
        known = np.isfinite(out[t, :, 0])
        if known.any():
            where = np.flatnonzero(known)
            for k in range(4):
                out[t, :, k] = np.interp(np.arange(PROFILE), where, out[t, known, k])
    for shot in np.unique(segment):
        index = np.flatnonzero(segment == shot)
        part = out[index]
        known = np.isfinite(part[:, 0, 0])
        if not known.any():
            out[index] = 0
            continue
        where = np.flatnonzero(known)
        nearest = where[np.abs(np.arange(len(index))[:, None] - where).argmin(1)]
        part = median_filter(part[nearest], (MEDIAN_FRAMES, 3, 1), mode="nearest")
        part = gaussian_filter1d(part, SMOOTH_FRAMES, axis=0, mode="nearest")
        out[index] = gaussian_filter1d(part, 1.0, axis=1, mode="nearest")
    return out


def wall_of(image: np.ndarray, behind: np.ndarray, person: np.ndarray) -> np.ndarray:
    """The plate (S, S, 3) float32 in the light of a frame (S, S, 3) with its person mask (S, S)."""
    return behind + slow_difference(image, behind, background_pixels(person))


def restore(
    image: np.ndarray, region: np.ndarray, wall: np.ndarray, growing: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """The frame without its head: (S, S, 3) uint8, equal to the image outside of the region.

    Args:
        image: (S, S, 3) uint8. region: (S, S) bool inpaint mask. wall: (S, S, 3), see `wall_of`.
        growing: colour and share of what grows into the inpaint mask.
    """
    colour, share = growing
    filled = wall + share[..., None] * (colour - wall)
    filled = np.clip(filled.round(), 0, 255).astype(np.uint8)
    return np.where(region[..., None], filled, image)


def rim(
    image: np.ndarray,
    region: np.ndarray,
    person: np.ndarray,
    growing: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """What grows into the inpaint mask, with what lies beside it going on into its rim.

    A neck grows from below; beside a jaw that rises steeply there is more of it, or a collar or
    hair, just across the inpaint mask's edge.

    Args:
        image: (S, S, 3) uint8. region: (S, S) bool inpaint mask. person: (S, S) mask, 0..1.
        growing: colour (S, S, 3) and share (S, S) of the :func:`neck`.
    """
    colour, share = growing
    if not region.any() or region.all():
        return growing
    distance = cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, 5)
    # Not the nearest pixel, but more of them the further in: a comb of streaks shows.
    beside = pull_push(image, np.where(region, 0, person).astype(np.float32))
    theirs = pull_push(person[..., None], (~region).astype(np.float32))[..., 0]
    unit = len(image) / REFERENCE_SIZE
    near = np.clip((RIM_END * unit - distance) / ((RIM_END - RIM_FULL) * unit), 0, 1) * region
    there = near * theirs
    mixed = colour + there[..., None] * (beside - colour)
    return mixed.astype(np.float32), np.maximum(share, there).astype(np.float32)


def slow_difference(image: np.ndarray, behind: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Low-frequency part (S, S, 3) of image - plate, carried on into what is not known."""
    size = len(image)
    small = (max(1, size // COARSE),) * 2
    weight = cv2.resize(known.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    difference = (image.astype(np.float32) - behind) * known[..., None]
    total = cv2.resize(difference, small, interpolation=cv2.INTER_AREA)
    mean = total / np.maximum(weight, 1e-6)[..., None]
    slow = pull_push(mean, np.where(weight > 0.2, 1.0, 0.0))
    slow = cv2.GaussianBlur(slow, (0, 0), 1.5)
    return cv2.resize(slow, (size, size), interpolation=cv2.INTER_CUBIC)


def neck(
    image: np.ndarray, region: np.ndarray, landmarks: np.ndarray, profile: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Colour (S, S, 3) and share (S, S) of what grows from below the inpaint mask up into it.

    Args:
        image: (S, S, 3) uint8. region: (S, S) bool inpaint mask. landmarks: (478, 2) px.
        profile: (PROFILE, 4) smoothed.
    """
    size = len(region)
    frame = NeckFrame.of(landmarks)
    across = np.clip(frame.position(size), 0, PROFILE - 1)
    by_column = np.stack(
        [np.interp(across, np.arange(PROFILE), profile[:, k]) for k in range(4)], axis=1
    )
    bottom = bottom_of(region)
    has_below = (bottom >= 0) & (bottom < size - 1)
    outside = np.abs(np.arange(size) - frame.middle) / frame.width - NECK_HALF_WIDTH
    height = frame.width * NECK_HEIGHT * np.clip(1 - outside / NECK_ROUNDING, 0.05, 1)
    above = (bottom[None] - np.arange(size)[:, None]) / height  # 0 at the mask's end, 1 at the top
    fade = np.clip((1 - above) / 0.3, 0, 1) * (above >= 0) * has_below
    share = (by_column[:, 3] * fade).astype(np.float32)
    colour = by_column[:, :3] * (1 - NECK_DARKENING * np.clip(above, 0, 1))[..., None]
    # Right at the seam it is this frame's own colour, so that no line shows.
    rows = np.clip(bottom + np.arange(1, SEAM_ROWS + 1)[:, None], 0, size - 1)
    own = cv2.GaussianBlur(image[rows, np.arange(size)].astype(np.float32).mean(0)[None], (0, 0), 1)
    seam = np.exp(-above * height / (SEAM_DEPTH * size / REFERENCE_SIZE))
    colour += np.where(above >= 0, seam, 0)[..., None] * (own - by_column[None, :, :3])
    return colour.astype(np.float32), share
