"""Composites a rendered head over a restored background, with a soft mask to paste it by.

S side of the crop in px. All lengths are given for S = 512 and scale with it.
"""

import cv2
import numpy as np

from dubbing.compositing.carried_jaw import FilmFace
from dubbing.compositing.face_mask import face_mask
from dubbing.compositing.film_look import in_focus
from dubbing.compositing.grade import graded
from dubbing.compositing.jaw_opening import comes_off, touching
from dubbing.compositing.light import HAZE, follow_light
from dubbing.compositing.neck import Neck, with_neck
from dubbing.compositing.skin_detail import with_detail_of
from dubbing.face.face_contour import face_contour
from dubbing.preparation.background.pixels import extent
from dubbing.preparation.film_frame import FilmFrame
from dubbing.preparation.matting.matting import REFERENCE_SIZE

INPAINT = 3  # px round letters from which the neck behind them is inpainted
HALF, OPAQUE = 128, 250  # of 255
FEATHER = 6  # px, inside the edge; less than the inpaint mask is wider than the old head


def replacement(film: FilmFrame, head: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The composite that replaces a frame of the film, and its mask; see `composite`.

    Captions and other things over the face in the film stay over it.

    Args:
        head: (S, S, 4) uint8, the learned one, colour premultiplied by opacity, and opacity.

    Returns:
        The composite (S, S, 3), its mask (S, S), and what is new in it (S, S), all uint8: the
        mask without the share of the film's own pixels, which a jaw or a neck takes along.
    """
    image, landmarks = film.image, film.landmarks
    size = len(image)
    bare = np.ones((size, size), bool) if film.overlay is None else film.overlay == 0
    contour = face_contour(landmarks, size)
    if film.grade is not None:
        head = graded(head, film.grade)
    lit = follow_light(image, film.matte, head, landmarks, film.haze, film.overlay)
    if film.overlay is not None:
        image = cv2.inpaint(image, film.overlay, INPAINT, cv2.INPAINT_TELEA)
    share = face_mask(landmarks, contour)
    if film.overlay is not None:
        share = np.minimum(share, 255 - film.overlay)
    person = bare & (film.matte >= OPAQUE)
    lit = in_focus(film.image, lit, person & (share < HALF), film.noise, film.motion)
    lit = with_detail_of(film.image, person, lit, share > 0, landmarks, film.noise)
    face = FilmFace(image, film.matte, film.overlay, landmarks, contour)
    motion = face.motion_to(lit[..., 3], film.jaw)
    neck = Neck.of(image, film.matte, contour)
    held = neck.clothes * touching(motion, landmarks, size)
    made = face.carried(lit, share, motion, held, neck.share)
    turned = comes_off(landmarks)
    under, stretched = with_neck(image, film.background, neck, made.head[..., 3], turned)
    picture, mask = composite(under, film.restored | stretched, made.head, made.share)
    own = made.kept + stretched * (1 - made.head[..., 3] / np.float32(255))
    return picture, mask, (mask * np.clip(1 - own, 0, 1)).round().astype(np.uint8)


def composite(
    background: np.ndarray, restored: np.ndarray, head: np.ndarray, share: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """C + (1 - a) * background, and the share of it that replaces the source.

    Args:
        background: (S, S, 3) uint8, equal to the source outside of the inpaint mask.
        restored: (S, S) bool, the inpaint mask: where the background is restored.
        head: (S, S, 4) uint8, colour premultiplied by opacity, and opacity.
        share: (S, S) uint8, share of each pixel that may be replaced; see `face_mask`.

    Returns:
        The composite (S, S, 3) uint8, and the mask (S, S) uint8 to paste it with. The mask is 0
        outside the inpaint mask and the head, where the source's pixels stay. Inside it rises to
        255 over a few px, so that no seam shows. It never exceeds ``share``.
    """
    scale = len(background) / REFERENCE_SIZE
    opacity = head[..., 3]
    inside = restored | (opacity > HAZE)
    mask = np.minimum(feathered(inside, max(1.0, FEATHER * scale)), share)
    out = background.copy()
    rows, columns = extent(share > 0)
    under = background[rows, columns].astype(np.float32)
    over = head[rows, columns].astype(np.float32)
    blended = over[..., :3] + (1 - over[..., 3:] / 255) * under
    out[rows, columns] = np.clip(blended.round(), 0, 255)
    return out, mask


def blend(image: np.ndarray, over: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """``over`` where the mask is 255, ``image`` where it is 0, blended between; (S, S, 3)."""
    rows, columns = extent(mask > 0)
    out = image.copy()
    share = mask[rows, columns, None].astype(np.float32) / 255
    below = image[rows, columns].astype(np.float32)
    out[rows, columns] = (below + share * (over[rows, columns] - below)).round()
    return out


def feathered(inside: np.ndarray, width: float) -> np.ndarray:
    """Mask (S, S) uint8: 0 outside, rising to 255 over ``width`` px inwards from the edge."""
    depth = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, 3)
    return (np.minimum(depth, width + 1) * (255 / (width + 1))).round().astype(np.uint8)
