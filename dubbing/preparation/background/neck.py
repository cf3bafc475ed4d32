"""The neck under the chin, extended upwards into the inpaint mask.

S is the side of the crop in px, T frames. The head's own pixels are never used: the neck is made
from pixels below the inpaint mask.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from dubbing.face.mesh_points import LEFT_EAR, RIGHT_EAR
from dubbing.preparation.matting.matting import REFERENCE_SIZE

PROFILE = 96  # samples across the neck, over PROFILE_SPAN face widths to both sides
PROFILE_SPAN = 1.0
PROFILE_DEPTH = 8  # px at S = 512 below the inpaint mask that are averaged
NECK_HEIGHT = 0.38  # face widths
NECK_HALF_WIDTH = 0.22  # face widths: the neck ends there and a collar begins
NECK_ROUNDING = 0.2  # face widths over which its height falls to 0
NECK_DARKENING = 0.12  # at its upper end, under the chin's shadow
SEAM_ROWS = 3  # px below the inpaint mask whose colour the seam takes
SEAM_DEPTH = 10.0  # px at S = 512 over which it blends into the smoothed colour
MEDIAN_FRAMES, SMOOTH_FRAMES = 9, 4.0


@dataclass(frozen=True)
class NeckFrame:
    """Sampling of a frame's neck profile: middle and width of the face in px."""

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

    Args:
        image: (S, S, 3), person: (S, S) mask, both uint8. region: (S, S) bool inpaint mask.
        landmarks: (478, 2) px.
    """
    size = len(image)
    bottom = bottom_of(region)
    depth = max(2, round(PROFILE_DEPTH * size / REFERENCE_SIZE))
    rows = np.clip(bottom + 1 + np.arange(depth)[:, None], 0, size - 1)
    columns = np.arange(size)[None]
    colour = image[rows, columns].astype(np.float32)
    share = person[rows, columns].astype(np.float32) / 255
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

    Gaps are filled across the profile, then from the nearest frame; without any, the share is 0.
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


def neck(
    image: np.ndarray, region: np.ndarray, landmarks: np.ndarray, profile: np.ndarray, unit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Colour (H, W, 3) and share (H, W) of the neck, extended up into the inpaint mask.

    Args:
        image: (H, W, 3) uint8, around the region. region: (H, W) bool inpaint mask.
        landmarks: (478, 2) px of the image. profile: (PROFILE, 4) smoothed.
        unit: px of the crop for one at S = 512.
    """
    height, width = region.shape
    frame = NeckFrame.of(landmarks)
    across = np.clip(frame.position(width), 0, PROFILE - 1)
    by_column = np.stack(
        [np.interp(across, np.arange(PROFILE), profile[:, k]) for k in range(4)], axis=1
    ).astype(np.float32)
    bottom = bottom_of(region)
    has_below = (bottom >= 0) & (bottom < height - 1)
    outside = np.abs(np.arange(width) - frame.middle) / frame.width - NECK_HALF_WIDTH
    tall = frame.width * NECK_HEIGHT * np.clip(1 - outside / NECK_ROUNDING, 0.05, 1)
    up = (bottom[None] - np.arange(height)[:, None]).astype(np.float32)  # px above the mask's end
    above = up / tall.astype(np.float32)  # 0 at the mask's end, 1 at the top
    share = np.clip((1 - above) / 0.3, 0, 1) * (above >= 0) * (by_column[:, 3] * has_below)
    darkened = 1 - np.float32(NECK_DARKENING) * np.clip(above, 0, 1)
    # At the seam it has this frame's own colour, so that no line shows.
    rows = np.clip(bottom + np.arange(1, SEAM_ROWS + 1)[:, None], 0, height - 1)
    own = image[rows, np.arange(width)].astype(np.float32).mean(0)
    own = cv2.GaussianBlur(own[None], (0, 0), 1)[0]
    seam = np.where(up >= 0, np.exp(-np.maximum(up, 0) / np.float32(SEAM_DEPTH * unit)), 0)
    planes = [darkened * by_column[:, k] + seam * (own[:, k] - by_column[:, k]) for k in range(3)]
    return cv2.merge([plane.astype(np.float32) for plane in planes]), share.astype(np.float32)
