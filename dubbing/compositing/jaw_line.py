"""The outline of a new head, as far beside the film's as words move it.

A jaw is higher or lower than lips say, and a pose is a little off: with the film's own lips a
learned head's outline lies some pixels beside the film's. A head with new lips lies as far beside
the right place, so it is moved back. S is the side of the crop in px, K angles. Lengths are for
S = 512 and scale with it.
"""

import warnings
from collections.abc import Sequence

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d

from dubbing.compositing.face_mask import jaw_share
from dubbing.compositing.neck import Neck
from dubbing.face.face_contour import FaceContour
from dubbing.face.mesh_points import CHIN, FOREHEAD_TOP
from dubbing.preparation.background.pixels import around, extent
from dubbing.preparation.matting.matting import REFERENCE_SIZE

FINE = 1024  # angles that offsets are interpolated to
ANGLES = np.arange(48) * (2 * np.pi / 48)  # at the middle of the face, from the image's right down
STEP = 1.0  # px along a ray
HALF = 127.5  # of 255: opacity at the outline
MOST = 16.0  # px that an outline is moved
UNLIKE = 30.0  # px: an outline so far away is another thing's
LOWER_LIP = 17  # of FaceMesh
STRETCHED = 0.8  # of the way from chin to lip, over which skin is stretched
UNSURE = 1.5  # px by which outlines differ by chance
# Heights above the chin, of the face's, between which a jaw's side begins; px beside it, and as
# many over which it fades. The same from a jaw to the clothes below the film's, smoothed along it.
SIDES, BESIDE, NEARLY, EVEN = (0.06, 0.18), 5.0, 7.0, 6.0


def radii(opacity: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """How far the outline of a head (S, S) uint8 is from the middle (2,) at `ANGLES`, (K,) px.

    NaN where there is no head in that direction.
    """
    way = np.arange(0, len(opacity), STEP, dtype=np.float32)
    x, y = (
        (k + turn(ANGLES)[:, None] * way).astype(np.float32)
        for k, turn in zip(middle, (np.cos, np.sin), strict=True)
    )
    along = cv2.remap(opacity, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    seen = along.astype(np.float32)
    inside = seen >= HALF
    last = len(way) - 1 - inside[:, ::-1].argmax(1)
    ray, after = np.arange(len(ANGLES)), np.minimum(last + 1, len(way) - 1)
    fall = np.maximum(seen[ray, last] - seen[ray, after], 1)
    part = np.clip((seen[ray, last] - HALF) / fall, 0, 1)
    return np.where(inside.any(1), way[last] + STEP * part, np.nan)


def beside(film: np.ndarray, head: np.ndarray, contour: FaceContour) -> np.ndarray:
    """How far the film's outline lies beyond a head's, (K,) px; NaN where that says nothing.

    Args:
        film, head: (S, S) uint8, opacities; the head has the film's lips.
        contour: of the film's face.
    """
    unit = len(film) / REFERENCE_SIZE
    apart = radii(film, contour.middle) - radii(head, contour.middle)
    apart[(jaw_share(contour, ANGLES) == 0) | ~(np.abs(apart) < UNLIKE * unit)] = np.nan
    return np.clip(apart, -MOST * unit, MOST * unit)


def jaw_lines(looked: np.ndarray, jaws: Sequence[np.ndarray], frames: np.ndarray) -> np.ndarray:
    """Offsets of the jaw line (F, K) px of frames (F,) of a shot; 0 where they are not known.

    Args:
        looked: (N,) frames that were compared. jaws: of each, (K,), see `beside`.
    """
    out = np.zeros((len(frames), len(ANGLES)), np.float32)
    if not len(looked):
        return out
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of medians of nothing
        padded = np.pad(np.stack(jaws), ((1, 1), (0, 0)), constant_values=np.nan)
        steady = np.nanmedian([padded[k : k + len(looked)] for k in range(3)], 0)
        even = np.nanmedian([np.roll(steady, k, 1) for k in (-1, 0, 1)], 0)
    for k, column in enumerate(even.T):
        known = np.isfinite(column)
        if known.any():
            out[:, k] = np.interp(frames, looked[known], column[known])
    return out


def moved(
    head: np.ndarray, offsets: np.ndarray, landmarks: np.ndarray, contour: FaceContour
) -> np.ndarray:
    """A head whose jaw line is moved outwards, (S, S, 4) uint8; lips stay where they are.

    Args:
        head: (S, S, 4) uint8. offsets: (K,) px, see `beside`.
        landmarks: (478, 2) px. contour: of these.
    """
    size = len(head)
    sure = np.maximum(np.abs(offsets) - UNSURE * size / REFERENCE_SIZE, 0)
    offsets = np.sign(offsets) * sure * jaw_share(contour, ANGLES)
    outline = radii(head[..., 3], contour.middle)
    known = np.isfinite(outline)
    part = extent(head[..., 3] > 0)
    if not known.any() or np.abs(offsets).max() < STEP:
        return head
    (rows, columns), _ = around(part, round(MOST * size / REFERENCE_SIZE) + 1, size)
    reach = STRETCHED * float(np.linalg.norm(landmarks[CHIN] - landmarks[LOWER_LIP]))
    # Between an angle that moves and the next, everything moves.
    moving = known & np.any([np.roll(offsets, k) != 0 for k in (-1, 0, 1)], axis=0)
    highest = float((np.sin(ANGLES) * np.nan_to_num(outline - reach))[moving].min(initial=0))
    top = max(rows.start, int(contour.middle[1] + highest) - 1)
    part = slice(min(top, rows.stop), rows.stop), columns
    y, x = (
        np.arange(i.start, i.stop, dtype=np.float32) - np.float32(k)
        for i, k in zip(part, contour.middle[::-1], strict=True)
    )
    angle, radius = np.arctan2(y[:, None], x), np.hypot(y[:, None], x)
    turn = (angle * (FINE / (2 * np.pi))).astype(np.int16) % FINE
    outer, offset = (
        np.interp(np.arange(FINE), at * (FINE / (2 * np.pi)), values, period=FINE)[turn]
        for at, values in ((ANGLES[known], outline[known]), (ANGLES, offsets))
    )
    share = np.clip(1 - (outer - radius) / max(reach, 1.0), 0, 1)
    shift = share * share * (3 - 2 * share) * offset
    kept = 1 - shift / np.maximum(radius, 1)
    column, row = (
        (kept * i + k).astype(np.float32)
        for i, k in zip((x, y[:, None]), contour.middle, strict=True)
    )
    out = head.copy()
    out[part] = cv2.remap(head, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return out


def beside_jaw(
    landmarks: np.ndarray, opacity: np.ndarray, shown: np.ndarray, neck: Neck
) -> np.ndarray:
    """Share of the film's own pixels beside a rendered jaw, (S, S) float32: skin that goes on.

    1 at its sides, `BESIDE` px on, and down to clothes that the film's jaw touches and the rendered
    one nearly does: their edge then is the film's. 0 below a chin that has a neck.

    Args:
        landmarks: (478, 2) px. opacity: (S, S) uint8 of the head. shown: (S, S) bool, its place.
        neck: of the film.
    """
    out, (rows, columns) = np.zeros(shown.shape, np.float32), extent(shown)
    if not shown.any():
        return out
    up = landmarks[FOREHEAD_TOP] - landmarks[CHIN]
    up = up / max(float(up @ up), 1.0)
    y, x = (
        np.arange(i.start, i.stop) - k
        for i, k in zip((rows, columns), landmarks[CHIN][::-1], strict=True)
    )
    height = x * up[0] + y[:, None] * up[1]
    free = (opacity[rows, columns] < HALF).astype(np.uint8)
    away = cv2.distanceTransform(free, cv2.DIST_L2, 3) * np.float32(REFERENCE_SIZE / len(shown))
    side = np.clip((height - SIDES[0]) / (SIDES[1] - SIDES[0]), 0, 1)
    below = np.clip(neck.low[columns].astype(int) - rows.start, 0, len(away) - 1)
    gap = away[below, np.arange(len(below))]
    even = gaussian_filter1d(gap, EVEN * len(shown) / REFERENCE_SIZE)
    on_clothes = neck.clothes[columns] * np.clip(2 - even / NEARLY, 0, 1)
    share = np.maximum(side * np.clip(2 - away / BESIDE, 0, 1), on_clothes)
    out[rows, columns] = share * shown[rows, columns]
    return out
