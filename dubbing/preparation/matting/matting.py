"""The head matte: a person mask cut along the jaw.

S is the side of the crop in px. Lengths are given for S = 512 and scale with it.
"""

import cv2
import numpy as np

REFERENCE_SIZE = 512
CUT_SOFTNESS = 1.2  # px, Gaussian
CUT_BELOW = 1.0  # px below the edge of the jaw, which the lens blurs
# Of the guided filter: px, and of colours in 0..1 the variance below which nothing is an edge.
EDGE_REACH, FLAT = 6.0, 1e-4
SUBSAMPLED = 0.5  # a third of the time, and no worse
EDGE_MIDDLE, EDGE_GAIN = 0.55, 2.0  # of the filtered mask: half opaque here, steeper by this factor
OPAQUE = 128  # of 255
LEAST = 0.02  # of the matte: less is not head
JAW_MARGIN = 3.0  # px outside of the matte that may still show some of a jaw


def above_jaw(outline: np.ndarray, size: int) -> np.ndarray:
    """Polygon (K + 4, 2) px of everything above the jaw, far beyond the image's edges.

    Args:
        outline: (K, 2) px from the left to the right ear lobe along the chin. Beyond the lobes the
            cut follows the line through them.
    """
    across = outline[-1] - outline[0]
    right = across / np.hypot(*across)
    far, up = 4 * size * right, 4 * size * np.array([right[1], -right[0]])
    left_end, right_end = outline[0] - far, outline[-1] + far
    return np.stack([left_end + up, left_end, *outline, right_end, right_end + up])


def fill_polygon(polygon: np.ndarray, size: int) -> np.ndarray:
    """Coverage (S, S) uint8, 255 for all, of a polygon (K, 2) px, with smooth edges."""
    out = np.zeros((size, size), np.uint8)
    shift = 4  # binary places of a pixel
    corners = (polygon * (1 << shift)).round().astype(np.int32)
    cv2.fillPoly(out, [corners], 255, lineType=cv2.LINE_AA, shift=shift)
    return out


def opacity(image: np.ndarray, person: np.ndarray) -> np.ndarray:
    """Opacity (S, S) float32 in 0..1 of a person, with edges that follow the image's.

    A guided filter (He, Sun and Tang 2010) moves the coarse edges of the mask to those of colours:
    lips and a wall are often of one brightness.

    Args:
        image: (S, S, 3) RGB uint8.
        person: (S, S) from :func:`person_masks`.
    """
    reach = max(1, round(EDGE_REACH * len(image) / REFERENCE_SIZE))
    # The filter needs guide and mask on the scale of the bytes.
    followed = cv2.ximgproc.guidedFilter(
        image, person * 255, reach, FLAT * 255**2, scale=SUBSAMPLED
    )
    return np.clip((followed / 255 - EDGE_MIDDLE) * EDGE_GAIN + 0.5, 0, 1)


def in_bytes(share: np.ndarray) -> np.ndarray:
    """An image of shares, 0..1, as uint8, 0..255."""
    return cv2.convertScaleAbs(share, alpha=255)


def above(outline: np.ndarray, size: int) -> np.ndarray:
    """Coverage (S, S) uint8 of what lies above an outline (K, 2) px, see :func:`above_jaw`."""
    unit = size / REFERENCE_SIZE
    face = fill_polygon(above_jaw(outline, size) + np.array([0, CUT_BELOW * unit]), size)
    return np.asarray(cv2.GaussianBlur(face, (0, 0), CUT_SOFTNESS * unit))


def head_matte(alpha: np.ndarray, face: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Matte (S, S) uint8 of the head with its hair, down to the jaw.

    Args:
        alpha: (S, S) uint8, from :func:`opacity`.
        face: (S, S) uint8, coverage of what may be head, from :func:`above`.
        inside: (2,) px, a point of the face: only the part connected to it is kept.
    """
    matte = cv2.multiply(alpha, face, scale=1 / 255)
    return np.where(component_at(matte > 5, inside), without_holes(matte), 0).astype(np.uint8)


def without_holes(matte: np.ndarray) -> np.ndarray:
    """A matte (S, S) uint8 whose transparent places inside the head are closed.

    Glints on hair and glasses are closed; places connected to the background stay open.
    """
    outside = np.pad(matte < OPAQUE, 1, constant_values=True).astype(np.uint8)
    _, labels = cv2.connectedComponents(outside, connectivity=4)
    open_places = labels[1:-1, 1:-1] == labels[0, 0]
    return np.where(open_places | (matte >= OPAQUE), matte, 255).astype(np.uint8)


def component_at(mask: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Connected part of a mask (S, S) bool that holds a point (2,) px; all of it if none does."""
    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    column, row = np.clip(point.round().astype(int), 0, np.array(mask.shape[::-1]) - 1)
    label = labels[row, column]
    return labels == label if label else mask


def inpaint_mask(matte: np.ndarray) -> np.ndarray:
    """Where the background is restored, (S, S) bool: the matte above .02, widened.

    By 8 px, and by 11 px upwards, where hair is finer than a matte.
    """
    unit = len(matte) / REFERENCE_SIZE
    head = matte > LEAST * 255
    higher = np.zeros_like(head)
    rise = max(1, round(4 * unit))
    higher[:-rise] = head[rise:]
    return dilate(higher, 7 * unit) | dilate(head, 8 * unit)


def covered(hole: np.ndarray, matte: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Pixels (S, S) bool of an inpaint mask that are to be restored: not the neck beside the jaw.

    Below the ear lobes there is no hair that a matte could miss, so pixels 3 px from it or more are
    visible.

    Args:
        hole: the :func:`inpaint_mask` (S, S) of the matte.
        outline: (K, 2) px, see :func:`above_jaw`.
    """
    size = len(matte)
    lobes = above_jaw(outline[[0, -1]], size)
    hair = fill_polygon(lobes, size) > 127
    jaw = dilate(matte > LEAST * 255, JAW_MARGIN * size / REFERENCE_SIZE)
    return hole & (hair | jaw)


def dilate(mask: np.ndarray, radius: float) -> np.ndarray:
    """A mask (S, S) bool widened by a disc of the given radius in px."""
    reach = max(1, round(radius))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return cv2.dilate(mask.astype(np.uint8), disc) > 0
