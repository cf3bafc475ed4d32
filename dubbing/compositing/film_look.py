"""The film's look on replaced pixels: its noise and its focus.

A rendered head has neither the noise of a frame nor the blur that its focus and its motion give.
Beside the replaced region film and render show the same skin. S side of the crop in px, H and W of
the film's frame.
"""

from __future__ import annotations

import cv2
import numpy as np

from dubbing.preparation.background.pixels import extent

COARSE = 1.2  # px, Gaussian: detail finer than that is compared
SIGMAS = np.array([0.0, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 2.8, 3.5])  # px, blurs that are tried
SHUTTERS = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])  # shares of a frame's time
MOVES = 1.5  # px a frame: a head that moves less has no blur of motion
LEAST_BLUR = 0.2  # px: less is next to nothing
LEAST = 150  # px that must be compared
OPAQUE = 250  # of 255
TELLING = 0.2  # share of a film's detail that is no noise: with less, noise hides its focus
SHARPER = 0.9  # share of the render's detail: a film that has more is as sharp
NOISE_SEED = 20240607
QUIET = 0.3  # levels: a film with less noise has none


def in_focus(
    image: np.ndarray, head: np.ndarray, beside: np.ndarray, noise: np.ndarray, motion: np.ndarray
) -> np.ndarray:
    """A head as blurred as the film, (S, S, 4) uint8.

    Args:
        image: (S, S, 3) uint8 of the film.
        head: (S, S, 4) uint8, colour premultiplied by opacity, and opacity.
        beside: (S, S) bool, where film and head show the same skin.
        noise: (NUMBERS,), see `film_noise`. motion: (2,) px that the head moves in a frame.
    """
    beside = cv2.erode((beside & (head[..., 3] >= OPAQUE)).astype(np.uint8), np.ones((5, 5))) > 0
    if beside.sum() < LEAST:
        return head
    part = extent(beside)
    here, grey = beside[part], [luma(x[part]) for x in (image, head[..., :3])]
    filmed = detail(grey[0], here)
    wanted = filmed - noise_in_detail(noise)
    if wanted < TELLING * filmed:
        return head
    if wanted >= SHARPER * detail(grey[1], here):
        return head
    if np.hypot(*motion) > MOVES:
        tried = [line(share * motion) for share in SHUTTERS]
        left = [detail(cv2.filter2D(grey[1], -1, kernel), here) for kernel in tried]
        share = between(np.array(left), SHUTTERS, wanted)
        return np.asarray(cv2.filter2D(head, -1, line(share * motion)))
    left = [detail(blurred(grey[1], sigma), here) for sigma in SIGMAS]
    return blurred(head, between(np.array(left), SIGMAS, wanted))


def with_noise(
    image: np.ndarray, replaced: np.ndarray, noise: np.ndarray, number: int
) -> np.ndarray:
    """A finished frame (H, W, 3) uint8 with the film's noise on the pixels that are replaced.

    Args:
        replaced: (H, W) uint8, by how much of 255.
        noise: (NUMBERS,), see `film_noise`.
        number: of the frame; the same number gives the same noise.
    """
    *deviation, shared, beside = noise.tolist()
    if max(deviation) < QUIET or not replaced.any():
        return image
    part = extent(replaced > 0)
    share = replaced[part].astype(np.float32) / 255
    drawn = np.random.default_rng([NOISE_SEED, number]).standard_normal(
        (*share.shape, 4), np.float32
    )
    mixed = np.sqrt(shared) * drawn[..., 3:] + np.sqrt(1 - shared) * drawn[..., :3]
    if beside > 0.05:
        mixed = cv2.GaussianBlur(mixed, (0, 0), 0.5 / np.sqrt(-np.log(beside)))
        mixed /= mixed.std()
    out = image.copy()
    # Blended with the film's pixels, which have noise of their own: variances add up to the film's.
    weight = np.sqrt(np.clip(1 - (1 - share) ** 2, 0, 1))[..., None]
    noisy = out[part] + weight * mixed * np.array(deviation, np.float32)
    out[part] = np.where(share[..., None] > 0, np.clip(noisy.round(), 0, 255), out[part])
    return out


def luma(image: np.ndarray) -> np.ndarray:
    """Luminance (H, W) float32 of (H, W, 3)."""
    return np.asarray(image.astype(np.float32) @ np.array([0.299, 0.587, 0.114], np.float32))


def blurred(image: np.ndarray, sigma: float) -> np.ndarray:
    """An image, blurred by a Gaussian of sigma px; as it is where that is next to nothing."""
    return image if sigma < LEAST_BLUR else np.asarray(cv2.GaussianBlur(image, (0, 0), sigma))


def detail(grey: np.ndarray, where: np.ndarray) -> float:
    """Energy of an image's detail finer than `COARSE`, the mean over some pixels."""
    band = grey - cv2.GaussianBlur(grey, (0, 0), COARSE)
    return float(np.square(band[where]).mean())


def noise_in_detail(noise: np.ndarray) -> float:
    """Energy that noise adds to the detail of a picture."""
    *deviation, shared, beside = noise.tolist()
    weights = np.array([0.299, 0.587, 0.114]) * deviation
    variance = shared * weights.sum() ** 2 + (1 - shared) * (weights**2).sum()
    grain = 0.5 / np.sqrt(-np.log(beside)) if beside > 0.05 else 0.0

    def shared_with(sigma: float) -> float:
        """Share of the variance of such grain that a Gaussian blur leaves, twice sigma wide."""
        return float((grain**2 + 0.08) / (grain**2 + sigma**2 + 0.08))

    return float(variance * (1 + shared_with(COARSE) - 2 * shared_with(COARSE / 2**0.5)))


def between(energies: np.ndarray, values: np.ndarray, wanted: float) -> float:
    """The value at which falling energies reach what is wanted."""
    return float(np.interp(-wanted, -np.minimum.accumulate(energies), values))


def line(motion: np.ndarray) -> np.ndarray:
    """Kernel of a motion (2,) px in the time that the shutter is open."""
    length = float(np.hypot(*motion))
    reach = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * reach + 1,) * 2, np.float32)
    for share in np.linspace(-0.5, 0.5, max(2, int(4 * length) + 1)):
        x, y = reach + share * motion
        left, top = int(np.floor(x)), int(np.floor(y))
        a, b = x - left, y - top
        for dx, dy, weight in ((0, 0, (1 - a) * (1 - b)), (1, 0, a * (1 - b)), (0, 1, (1 - a) * b)):
            kernel[top + dy, left + dx] += weight
        kernel[top + 1, left + 1] += a * b
    return kernel / kernel.sum()
