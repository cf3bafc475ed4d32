"""The film's own detail on the new skin.

A head is blended from several frames, so its skin is smoother than the film's. The film's frame
shows the same skin, moved by the jaw. S is the side of the crop in px; lengths are for S = 512 and
scale with it.
"""

from __future__ import annotations

import cv2
import numpy as np

from dubbing.compositing.film_look import detail, luma, noise_in_detail
from dubbing.face.mouth.lip_region import lip_region
from dubbing.preparation.background.pixels import extent, rounded, spread
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

FINE = 3.2  # px, Gaussian: what is finer is detail
INSIDE = 8  # px from the edge of what is taken: the old chin's edge is no detail of skin
LIPS = 8  # px round the lips in which nothing is taken or given; they say other words
FADE = 4.0  # px over which that fades
WINDOW = 18  # px in which motion is the same, at half the size
ALIKE, UNLIKE = 7.0, 14.0  # levels by which the same skin may differ, smoothed
EVEN = 1.2  # px, whatever S is: weights are smoothed
CLEAN = 0.25  # share of a film's detail that may be noise: replaced pixels get noise of their own
OPAQUE = 250  # of 255


def with_detail_of(
    image: np.ndarray,
    shown: np.ndarray,
    head: np.ndarray,
    replaced: np.ndarray,
    landmarks: np.ndarray,
    noise: np.ndarray,
) -> np.ndarray:
    """A head (S, S, 4) uint8 whose skin has the detail of the film's.

    Args:
        image: (S, S, 3) uint8 of the film. shown: (S, S) bool, where that is the person alone.
        head: (S, S, 4) uint8, colour premultiplied by opacity, and opacity.
        replaced: (S, S) bool, where it is shown. landmarks: (478, 2) px.
        noise: (NUMBERS,), see `film_noise`.
    """
    unit = len(image) / REFERENCE_SIZE
    skin = shown & replaced & (head[..., 3] >= OPAQUE)
    if not skin.any():
        return head
    part = extent(replaced)
    colours, opacity = head[part][..., :3], head[part][..., 3]
    film, new = luma(image[part]), luma(colours)
    if noise_in_detail(noise) > CLEAN * detail(film, skin[part]):
        return head
    over = new + (1 - opacity / np.float32(255)) * film
    there = motion(over, film, unit)

    def seen(values: np.ndarray) -> np.ndarray:
        """Values of the film where the head has the same skin."""
        return np.asarray(cv2.remap(values, *there, cv2.INTER_LINEAR))

    apart = np.abs(cv2.GaussianBlur(seen(film) - over, (0, 0), FINE * unit))
    lips = lip_share(lip_region(landmarks, len(image))[part], unit)
    within = np.ones((2 * round(INSIDE * unit) + 1,) * 2, np.uint8)
    inside = cv2.erode(shown[part].astype(np.uint8), within).astype(np.float32)
    same = (opacity >= OPAQUE) & (seen(inside) > 0.99)
    alike = np.clip((UNLIKE - apart) / (UNLIKE - ALIKE), 0, 1)
    share = np.where(same, alike * (1 - lips) * (1 - seen(lips)), 0).astype(np.float32)
    weight = cv2.GaussianBlur(cv2.erode(share, np.ones((3, 3), np.uint8)), (0, 0), EVEN)
    # Of colour there is hardly any detail, and films have it at half the size.
    fine, own = (x - cv2.GaussianBlur(x, (0, 0), FINE * unit) for x in (film, new))
    here = cv2.remap(fine, *there, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    out = head.copy()
    changed = rounded(colours.astype(np.float32) + spread(weight * (here - own)))
    out[part][..., :3] = np.minimum(changed, opacity[..., None])
    return out


def motion(new: np.ndarray, old: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of a picture (H, W) float32 lies in another one: x and y, (H, W) px.

    Dense flow after Farneback (2003), at half the size.
    """
    height, width = new.shape
    half = (max(1, width // 2), max(1, height // 2))
    small = [cv2.resize(x, half, interpolation=cv2.INTER_AREA) for x in (new, old)]
    first, second = (x.clip(0, 255).astype(np.uint8) for x in small)
    window = max(5, round(WINDOW * unit) | 1)
    flow = np.zeros((half[1], half[0], 2), np.float32)
    flow = cv2.calcOpticalFlowFarneback(
        first, second, flow, 0.5, 3, window, 2, 5, 1.1, cv2.OPTFLOW_FARNEBACK_GAUSSIAN
    )
    flow = cv2.resize(flow, (width, height)) * np.array([width / half[0], height / half[1]])
    y, x = np.mgrid[:height, :width]
    return (x + flow[..., 0]).astype(np.float32), (y + flow[..., 1]).astype(np.float32)


def lip_share(lips: np.ndarray, unit: float) -> np.ndarray:
    """Mask (H, W) float32 of the film's lips (H, W) bool: 1 on them, 0 away from them."""
    wide = dilate(lips, LIPS * unit).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(wide, (0, 0), FADE * unit))
