"""Relights a rendered head to match the light of the film's frame.

A head is rendered in the light of the clip. Where film and render show the same skin, round the
replaced region and on cheeks and chin, the ratio of their colours is measured. Its slowly varying
part is light, and is applied to the render. S side of the crop in px; lengths are for S = 512 and
scale with it.
"""

import cv2
import numpy as np

from dubbing.face.mesh_points import NOSE_BASE
from dubbing.face.mouth.lip_region import lip_region
from dubbing.preparation.background.pixels import around, extent
from dubbing.preparation.covering.light import shade
from dubbing.preparation.matting.matting import REFERENCE_SIZE, dilate

STEP = 4  # px between places where the ratio is measured
SMOOTH = 36.0  # px, Gaussian: faster variation is skin, not light
# px, Gaussian: of shadows on a part of the face, down to those of noses in light from another side;
# and the share of places around that must be known, below which they fade.
SHADOWS = ((36.0, 0.02), (16.0, 0.02), (8.0, 0.3), (4.0, 0.3))
# Of a logarithm: where so much of the face above the mouth is off by the first, shadows begin to be
# followed, from the second on in full.
DEEP, DEEPER = 0.12, 0.15
REDDER = 0.4  # of a shadow's logarithm: by so much, channels may differ
FAINT = 0.06  # of a logarithm: shallower places are not followed
USUAL, MOST = 90, 98  # percent of the face above the mouth: is there a shadow, and how deep is it
MOUTH = 8.0  # px round the film's lips, which move with other words
# Px round them in which the new mouth may open, and how dark the head is there, as a share of what
# is around: then it is no skin.
OPENED, AS_DARK = 32.0, 0.75
HAZE, OPAQUE = 16, 250  # of 255; a head with no more than the first is haze
DARK = 4.0  # grey levels added before the ratio is taken: black has none
PRIOR_WEIGHT = 0.02  # of the whole face's ratio beside that of the neighbourhood
MIN_SHARE = 0.002  # of the crop's pixels that must show the same skin; with fewer, no relighting
OUTLIER = 0.35  # of a logarithm from the median: a place that far off counts half
# Grey levels of the film: a brighter place may be as bright as one likes, as in a flash. Percent of
# the places that must be darker; with fewer, the light is the least by which so many are white.
WHITE, DARKER, WHITER = 250.0, 5.0, 95.0


def follow_light(
    image: np.ndarray,
    matte: np.ndarray,
    head: np.ndarray,
    landmarks: np.ndarray,
    haze: np.ndarray,
    overlay: np.ndarray | None = None,
) -> np.ndarray:
    """The head in the light of the frame, (S, S, 4) uint8, colour premultiplied by opacity.

    Args:
        image: (S, S, 3), matte: (S, S) uint8 of the film.
        head: (S, S, 4) uint8, colour premultiplied by opacity, and opacity.
        landmarks: (478, 2) px of the film's face.
        haze: (3,) grey levels of light added over the image, which no ratio explains.
        overlay: (S, S) uint8, above 0 where something lies over the face.
    """
    size = len(image)
    unit = size / REFERENCE_SIZE
    step = max(1, round(STEP * unit))
    # Only where the head is, from block to block, and one block more.
    rows, columns = (
        slice(i.start // step * step, i.stop // step * step)
        for i in around(extent(head[..., 3] > HAZE), 2 * step, size)[0]
    )
    part = rows, columns
    region = lip_region(landmarks, size)[part]
    lips = dilate(region, MOUTH * unit)
    skin = (head[part][..., 3] >= OPAQUE) & ~lips
    if overlay is not None:
        skin &= overlay[part] == 0
    least = MIN_SHARE * size**2
    same = skin & (matte[part] >= OPAQUE)
    if same.sum() < least:  # a frame so pale or so dark that no person is found in it
        same = skin
    if same.sum() < least:
        return head
    counts = same.astype(np.uint8)
    share = _small(counts, step)[..., None]
    filmed, rendered = (
        _small(cv2.bitwise_and(pixels[part], pixels[part], mask=counts), step)[..., :3]
        / np.maximum(share, 1e-6)
        for pixels in (image, head)
    )
    bright = rendered.mean(-1)
    level, known = (
        cv2.GaussianBlur(x, (0, 0), SMOOTH * unit / step)
        for x in (bright * share[..., 0], share[..., 0])
    )
    dark = bright * known < AS_DARK * level
    opened = _small(dilate(region, OPENED * unit).astype(np.uint8), step) > 0
    share = share * ~(opened & dark)[..., None]
    ratio = np.log(np.maximum(filmed - haze, 0) + DARK) - np.log(rendered + DARK)
    clipped = filmed > WHITE
    middle = _usual(ratio, clipped, share[..., 0] > 0.5)
    ratio = np.where(clipped, np.maximum(ratio, middle), ratio)
    weight = share / (1 + (np.abs(ratio - middle) / OUTLIER) ** 2)
    sigma = SMOOTH * unit / step
    near, apart = (
        cv2.GaussianBlur(x, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        for x in (weight, weight * (ratio - middle))
    )
    slow = middle + apart / (near + PRIOR_WEIGHT)
    above = share[: max(0, int(landmarks[NOSE_BASE, 1] - rows.start) // step), :, 0] > 0.5
    rest = np.abs((ratio - slow).mean(-1))[: len(above)][above]
    usual = np.percentile(rest, USUAL) if len(rest) else 0.0
    followed = np.clip((usual - DEEP) / (DEEPER - DEEP), 0, 1)
    for reach, least in SHADOWS if followed else ():
        cast = shade(ratio - slow, share[..., 0], reach * unit / step, least, REDDER)
        depth = np.abs(cast.mean(-1, keepdims=True))
        # A chin that moves is no shadow: one that passes falls on the rest of the face, too.
        deepest = np.percentile(depth[: len(above)][above], MOST)
        slow += followed * cast * np.clip(np.minimum(depth, deepest) / FAINT - 1, 0, 1)
    side = same.shape[::-1]
    gain = cv2.resize(np.exp(slow).astype(np.float32), side, interpolation=cv2.INTER_LINEAR)
    out = head.copy()
    colour, most = head[part][..., :3], head[part][..., 3:]
    opacity = most.astype(np.float32) / 255
    lit = (colour + DARK * opacity) * gain + (haze - DARK).astype(np.float32) * opacity
    out[part][..., :3] = np.clip(lit.round(), 0, most)
    return out


def _usual(ratio: np.ndarray, clipped: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Median (3,) of ratios (H, W, 3) of the places (H, W) bool that are seen, and not clipped."""
    if not seen.any():
        return np.asarray(ratio.mean((0, 1)))
    dark = np.where(clipped[seen], np.nan, ratio[seen])
    told = np.isfinite(dark).mean(0) * 100 > DARKER
    return np.where(
        told, np.nanmedian(np.where(told, dark, 0), 0), np.percentile(ratio[seen], WHITER, 0)
    )


def _small(image: np.ndarray, step: int) -> np.ndarray:
    """An image (H, W[, C]) uint8 downsampled: each pixel the mean of a block, `step` px a side."""
    side = image.shape[1] // step, image.shape[0] // step
    return np.asarray(cv2.resize(image.astype(np.float32), side, interpolation=cv2.INTER_AREA))
