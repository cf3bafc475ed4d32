"""How a film is graded beside the learned head: its contrast, saturation and black.

A head has the colours of the clip that it was learned from. Another film may be paler or fade its
blacks, or a glare lies over a shot. No gain explains that: lips become too red, and an open mouth
too black. Where film and head show the same face with the same lips, the film's colours are

    gain * (contrast * colour + grey * luma + black)

by least squares in which outliers hardly count (Geman and McClure 1987). The gain is the light,
which varies slowly over the face. A grade is contrast, grey and black, (3,); `NEUTRAL` changes
nothing.

Where film and head do not show quite the same, as in light from another side, least squares find
less contrast in the film than there is, and as much less in the head if that is fitted to the film.
So the contrast of luma is the geometric mean of both (reduced major axis regression).
"""

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.ndimage import median_filter

LUMA = np.array([0.299, 0.587, 0.114])
NEUTRAL = np.array([1.0, 0, 0])
SLOW = 9.0  # px at `comparison.EYES`, Gaussian: what varies more slowly is light
ROUNDS = 3  # of least squares, each with the light and the weights of the one before
STEADY = 3.0  # grey levels: keeps a grade neutral where colours are alike
APART = 3.0  # deviations at which a place counts a quarter: a hand, a caption may lie there
LEAST = 300  # px of a face
LEAST_SLOPE = 0.1  # of luma that is fitted
WHITE = 255.0
MOST = 95  # percent of the colours that are changed by less than the grade's change
# Grey levels of change up to which a grade is not applied, and from which it is in full. The clip
# that was learned from differs from its head by up to 4, as a head is smoother than a film.
CHANGES_FROM, CHANGES_FULL = 8.0, 16.0
LOOKS = 9  # of which the median counts


def measured(picture: np.ndarray, head: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The grade of a film's frame, and by how many grey levels it changes colours, (4,).

    NaN where too little of the face is known.

    Args:
        picture: (H, W, 3) the film, 0..255. head: (H, W, 3), the learned one in the same place.
        known: (H, W) bool, where both show the face.
    """
    if known.sum() < LEAST:
        return np.full(4, np.nan)
    (colour, luma), (_, back) = fitted(picture, head, known), fitted(head, picture, known)
    luma = np.sqrt(max(luma, LEAST_SLOPE) / max(back, LEAST_SLOPE))
    own = head[known].astype(np.float64)
    terms, share = _terms(own)
    of = np.array([colour, luma - colour, 0])
    of[2] = (1 - colour - share[0] * of[1]) / share[1]
    change = np.percentile(np.abs(np.tensordot(of, terms, 1) - own).max(1), MOST)
    return np.append(of * (1, 1, WHITE), change)


def _terms(own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The factors of contrast, grey and black, (3, n, 3), for colours (n, 3); and the share of the
    latter two in the mean colour, (2,)."""
    terms = np.stack([own, np.repeat((own @ LUMA)[:, None], 3, 1), np.full_like(own, WHITE)])
    return terms, terms[1:].mean((1, 2)) / max(float(own.mean()), 1.0)


def fitted(picture: np.ndarray, head: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The contrasts of colour and luma that explain a picture best, (2,); see `measured`."""
    film, own = picture[known].astype(np.float64), head[known].astype(np.float64)
    # Contrast follows from the rest, as the mean stays: how bright a film is says the light.
    terms, share = _terms(own)
    weight, rest = np.ones(len(own)), np.zeros(2)

    def around(colours: np.ndarray) -> np.ndarray:
        image = np.zeros((*picture.shape[:2], colours.shape[-1]), np.float32)
        image[known] = weight[:, None] * colours
        image = cv2.GaussianBlur(image, (0, 0), SLOW).reshape(image.shape)
        return np.asarray(image[known], np.float64)

    # Begun with what a neutral grade does not explain: most of a face that a picture lies over is
    # still its own, and decides.
    for done in range(ROUNDS + 1):
        near = np.maximum(around(np.ones((len(own), 1))), 1e-3)
        middle = np.maximum(around(film) / near, 1)
        # What is left of `film / middle * terms' middle = terms`, once the light is taken out.
        left = np.stack([film / middle * (around(term) / near) - term for term in terms])
        free = left[1:] - share[:, None, None] * left[0]
        if done:
            square = np.einsum("n,inc,jnc->ij", weight, free, free)
            square += np.eye(2) * STEADY**2 * len(own)
            rest = -np.linalg.solve(square, np.einsum("n,inc,nc->i", weight, free, left[0]))
        off = np.abs(left[0] + np.tensordot(rest, free, 1)).max(1)
        weight = 1 / (1 + (off / (APART * (1.4826 * float(np.median(off)) + 1))) ** 2) ** 2
    colour = 1 - share @ rest
    return np.array([colour, colour + rest[0]])


def noticed(grade: np.ndarray) -> np.ndarray:
    """Grades (..., 3) to apply, of measured ones (..., 4): neutral for small or unknown ones."""
    share = np.clip((grade[..., 3:] - CHANGES_FROM) / (CHANGES_FULL - CHANGES_FROM), 0, 1)
    return np.where(share > 0, NEUTRAL + share * (grade[..., :3] - NEUTRAL), NEUTRAL)


def grades(looked: np.ndarray, found: Sequence[np.ndarray], frames: np.ndarray) -> np.ndarray:
    """Grades (F, 3) of frames (F,) of a shot.

    Args:
        looked: (N,) frames that were compared. found: of each, (4,), see `measured`.
    """
    if not len(looked):
        return np.tile(NEUTRAL, (len(frames), 1))
    known = np.where(np.isfinite(found), found, (*NEUTRAL, 0))
    steady = noticed(median_filter(known, (LOOKS, 1), mode="nearest"))
    return np.stack([np.interp(frames, looked, column) for column in steady.T], 1)


def graded(head: np.ndarray, grade: np.ndarray) -> np.ndarray:
    """A head as the film is graded, (S, S, 4) uint8, colour premultiplied by opacity.

    Args:
        head: the same. grade: (3,).
    """
    if np.array_equal(grade, NEUTRAL):
        return head
    out = head.copy()
    out[..., :3] = np.minimum(cv2.transform(head, _matrix(grade)), head[..., 3:])
    return out


def graded_colours(head: np.ndarray, grade: np.ndarray) -> np.ndarray:
    """Colours (H, W, 3) 0..255 of an opaque head as the film is graded."""
    opaque = cv2.merge([*cv2.split(head), np.full(head.shape[:2], WHITE, head.dtype)])
    return np.asarray(np.clip(cv2.transform(opaque, _matrix(grade)), 0, WHITE))


def _matrix(grade: np.ndarray) -> np.ndarray:
    """The matrix (3, 4) that grades premultiplied colours and opacity."""
    colour = grade[0] * np.eye(3) + grade[1] * LUMA
    return np.column_stack([colour, np.full(3, grade[2] / WHITE)])
