"""The neck that a closing jaw uncovers: the film's own, stretched up to the new chin.

Where the film's jaw is lower than the rendered one, the picture has no neck for what is between
them. Skin, shadow and folds below the film's chin are there, only too low. Lines from the middle
of the face through the jaw are numbered by their angle (A of them); lengths along them are in px,
given for S = 512 and scaled. S is the side of the crop.
"""

import cv2
import numpy as np

from dubbing.compositing.face_mask import face_middle, jaw_share
from dubbing.preparation.matting.matting import REFERENCE_SIZE

ANGLES = 720
SMOOTH = 4  # lines, standard deviation: outlines are smoothed by 2 degrees
BESIDE = 3.0  # px from the outline of the film's jaw to where nothing of it is left
REACH = 40.0  # px of neck that are stretched, where there are so many
SKIN = 0.05  # a neck's share of red may be that much lower than the face's; a collar's is lower
LEAST, ENOUGH = 8.0, 20.0  # px of neck below the chin: too few to be stretched, and enough
UNDER = 12.0  # px that the neck goes on under the edge of the head


def with_neck(
    image: np.ndarray,
    background: np.ndarray,
    matte: np.ndarray,
    opacity: np.ndarray,
    landmarks: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """A background whose neck reaches up to the rendered chin, and where it differs by that.

    A line keeps its background where the rendered jaw covers the film's, where a collar begins too
    soon below the chin, and where there is no head.

    Args:
        image: (S, S, 3) uint8 frame of the film. background: the same with its head removed.
        matte, opacity: (S, S) uint8 of the film's head and of the rendered one.
        landmarks: (478, 2) px of the film's face.

    Returns:
        (S, S, 3) uint8 and (S, S) bool.
    """
    size = len(image)
    unit = size / REFERENCE_SIZE
    middle = face_middle(landmarks)
    low = smooth(outline(matte, middle)) + BESIDE * unit
    high = smooth(outline(opacity, middle))
    jaw = jaw_share(landmarks, np.arange(ANGLES) * (2 * np.pi / ANGLES))
    room = smooth(room_below(image, low, middle, jaw > 0))
    share = jaw * np.clip((room / unit - LEAST) / (ENOUGH - LEAST), 0, 1)
    share[(high >= low) | (high < low / 2)] = 0  # covered, or there is no head
    if not share.any():
        return background, np.zeros((size, size), bool)
    inner, outer = high - UNDER * unit, low + room
    rows, columns = extent(share > 0, inner, outer, middle, size)
    y, x = (
        np.arange(k.start, k.stop) - place
        for k, place in zip((rows, columns), middle[::-1], strict=True)
    )
    radius = np.hypot(y[:, None], x).astype(np.float32)
    line = np.arctan2(y[:, None], x) * (ANGLES / (2 * np.pi))

    def at(values: np.ndarray) -> np.ndarray:
        """Values of the lines at every pixel."""
        return np.interp(line, np.arange(ANGLES), values, period=ANGLES).astype(np.float32)

    end = at(outer)
    stretched = end - (end - radius) * at(room / np.maximum(outer - high, unit))
    source = np.maximum(stretched, at(low)) / np.maximum(radius, 1)
    neck = cv2.remap(
        image,
        (middle[0] + x * source).astype(np.float32),
        (middle[1] + y[:, None] * source).astype(np.float32),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    weight = at(share) * ((radius < end) & (radius > at(inner)))
    below = background[rows, columns]
    made, where = background.copy(), np.zeros((size, size), bool)
    mixed = below + weight[..., None] * (neck.astype(np.float32) - below)
    made[rows, columns], where[rows, columns] = mixed.round(), weight > 0
    return made, where


def extent(
    lines: np.ndarray, inner: np.ndarray, outer: np.ndarray, middle: np.ndarray, size: int
) -> tuple[slice, slice]:
    """Rows and columns that hold some lines (A,) bool, each from one radius (A,) to another."""
    angles = np.flatnonzero(np.convolve(np.pad(lines, 1, mode="wrap"), np.ones(3), "valid"))
    radii = np.stack([inner[angles], outer[angles]])
    turned = angles * (2 * np.pi / ANGLES)
    found = []
    for place, unit in ((middle[1], np.sin(turned)), (middle[0], np.cos(turned))):
        ends = place + radii * unit
        first, last = np.clip([np.floor(ends.min()), np.ceil(ends.max()) + 1], 0, size).astype(int)
        found.append(slice(first, last))
    return found[0], found[1]


def outline(head: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Where each line (A,) leaves a head (S, S) uint8 for good, px from the middle (2,)."""
    lines = along(head, middle)
    inside = lines >= 127.5
    inside[:, 0], inside[:, -1] = True, False
    last = lines.shape[1] - 1 - inside[:, ::-1].argmax(1)
    each = np.arange(ANGLES)
    before, after = lines[each, last], lines[each, last + 1]
    part: np.ndarray = np.clip((before - 127.5) / np.maximum(before - after, 1), 0, 1)
    return last + part


def room_below(
    image: np.ndarray, low: np.ndarray, middle: np.ndarray, jaw: np.ndarray
) -> np.ndarray:
    """Px of neck (A,), `REACH` at most, that each line has below the chin (A,).

    Neck is what is as red as the face, as skin in a shadow is, and more so. The lines `jaw` (A,)
    bool go through the lower face, where that is measured.
    """
    unit = len(image) / REFERENCE_SIZE
    lines = along(cv2.blur(image, (3, 3)), middle) + 1
    red = lines[..., 0] / lines.sum(2)
    place = np.arange(lines.shape[1])
    face = (place > low[:, None] / 2) & (place < low[:, None] - 2 * BESIDE * unit)
    skin = red[face & jaw[:, None]]
    if not skin.size:
        return np.zeros(ANGLES)
    other = (red < np.median(skin) - SKIN) & (place >= low[:, None])
    first = np.where(other.any(1), other.argmax(1), len(place)) - low
    # A collar that one line misses, the lines beside it see.
    reach = 2 * SMOOTH
    near = cv2.erode(np.pad(first, reach, mode="wrap"), np.ones((2 * reach + 1, 1)))
    room: np.ndarray = np.clip(near[reach:-reach, 0], 0, REACH * unit)
    return room


def along(picture: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """A picture (S, S[, 3]) along the lines: (A, S / 2[, 3]) float32, a px apart; 0 beyond it."""
    length = len(picture) // 2
    flags = cv2.INTER_LINEAR + cv2.WARP_FILL_OUTLIERS
    centre = (float(middle[0]), float(middle[1]))
    return cv2.warpPolar(picture, (length, ANGLES), centre, length, flags).astype(np.float32)


def smooth(values: np.ndarray) -> np.ndarray:
    """Values (A,) of the lines, smoothed over those beside them."""
    reach = 3 * SMOOTH
    kernel = cv2.getGaussianKernel(2 * reach + 1, SMOOTH)[:, 0]
    return np.convolve(np.pad(values, reach, mode="wrap"), kernel, "valid")
