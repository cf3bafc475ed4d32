"""The neck that a closing jaw uncovers: the film's own neck, stretched up to the new chin.

Where the film's jaw is lower than the rendered one, the image has no neck between them. Skin,
shadow and folds exist below the film's chin, only too low. So they are stretched along lines from
the middle of the face through the jaw, numbered by their angle (A of them). Lengths along them are
in px, given for S = 512 and scaled. S is the side of the crop.
"""

import cv2
import numpy as np

from dubbing.compositing.face_mask import jaw_share
from dubbing.face.face_contour import FaceContour
from dubbing.preparation.matting.matting import REFERENCE_SIZE

ANGLES = 720
SMOOTH = 4  # lines, standard deviation: outlines are smoothed by 2 degrees
BESIDE = 3.0  # px from the outline of the film's jaw to where none of it shows
MAX_NECK_PX = 40.0  # of neck that are stretched
SKIN = 0.05  # how much lower a neck's share of red may be than the face's; a collar's is lower
TOO_FEW, ENOUGH = 8.0, 20.0  # px of neck below the chin to stretch
UNDER = 12.0  # px that the neck extends under the edge of the head


def with_neck(
    image: np.ndarray,
    background: np.ndarray,
    matte: np.ndarray,
    opacity: np.ndarray,
    contour: FaceContour,
) -> tuple[np.ndarray, np.ndarray]:
    """A background whose neck reaches up to the rendered chin, and the pixels that it changed.

    A line keeps its background where the rendered jaw covers the film's, where a collar begins too
    close below the chin, and where there is no head.

    Args:
        image: (S, S, 3) uint8 frame of the film. background: the same with its head removed.
        matte, opacity: (S, S) uint8 of the film's head and of the rendered one.
        contour: of the film's face.

    Returns:
        (S, S, 3) uint8 and (S, S) bool.
    """
    size = len(image)
    unit = size / REFERENCE_SIZE
    middle = contour.middle
    low = smooth(outline(matte, middle)) + BESIDE * unit
    high = smooth(outline(opacity, middle))
    jaw = jaw_share(contour, np.arange(ANGLES) * (2 * np.pi / ANGLES))
    room = smooth(room_below(image, low, middle, jaw > 0))
    share = jaw * np.clip((room / unit - TOO_FEW) / (ENOUGH - TOO_FEW), 0, 1)
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
    out, changed = background.copy(), np.zeros((size, size), bool)
    blended = below + weight[..., None] * (neck.astype(np.float32) - below)
    out[rows, columns], changed[rows, columns] = blended.round(), weight > 0
    return out, changed


def extent(
    lines: np.ndarray, inner: np.ndarray, outer: np.ndarray, middle: np.ndarray, size: int
) -> tuple[slice, slice]:
    """Rows and columns that hold some lines (A,) bool, each from one radius (A,) to another."""
    angles = np.flatnonzero(np.convolve(np.pad(lines, 1, mode="wrap"), np.ones(3), "valid"))
    radii = np.stack([inner[angles], outer[angles]])
    turned = angles * (2 * np.pi / ANGLES)
    slices = []
    for place, unit in ((middle[1], np.sin(turned)), (middle[0], np.cos(turned))):
        ends = place + radii * unit
        first, last = np.clip([np.floor(ends.min()), np.ceil(ends.max()) + 1], 0, size).astype(int)
        slices.append(slice(first, last))
    return slices[0], slices[1]


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
    """Px of neck (A,), at most `MAX_NECK_PX`, that each line has below the chin (A,).

    Pixels at least about as red as the face are neck; skin in a shadow is redder. The redness of
    the face is measured on the lines `jaw` (A,) bool, through the lower face.
    """
    unit = len(image) / REFERENCE_SIZE
    lines = along(cv2.blur(image, (3, 3)), middle) + 1
    red = lines[..., 0] / (lines[..., 0] + lines[..., 1] + lines[..., 2])
    place = np.arange(lines.shape[1])
    face = (place > low[:, None] / 2) & (place < low[:, None] - 2 * BESIDE * unit)
    skin = red[face & jaw[:, None]]
    if not skin.size:
        return np.zeros(ANGLES)
    other = (red < np.median(skin) - SKIN) & (place >= low[:, None])
    first = np.where(other.any(1), other.argmax(1), len(place)) - low
    # Lines beside one that misses a collar meet it.
    reach = 2 * SMOOTH
    near = cv2.erode(np.pad(first, reach, mode="wrap"), np.ones((2 * reach + 1, 1)))
    room: np.ndarray = np.clip(near[reach:-reach, 0], 0, MAX_NECK_PX * unit)
    return room


def along(image: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """An image (S, S[, 3]) along the lines: (A, S / 2[, 3]) float32, a px apart; 0 beyond it."""
    length = len(image) // 2
    flags = cv2.INTER_LINEAR + cv2.WARP_FILL_OUTLIERS
    centre = (float(middle[0]), float(middle[1]))
    return cv2.warpPolar(image, (length, ANGLES), centre, length, flags).astype(np.float32)


def smooth(values: np.ndarray) -> np.ndarray:
    """Values (A,) of the lines, smoothed over neighbouring lines."""
    reach = 3 * SMOOTH
    kernel = cv2.getGaussianKernel(2 * reach + 1, SMOOTH)[:, 0]
    return np.convolve(np.pad(values, reach, mode="wrap"), kernel, "valid")
