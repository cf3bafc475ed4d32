"""Cuts out what lies over a face, in the frame of the face; see `comparison`.

Beside the lips it is what differs from the head by more than usual, and over more than a fold of
skin. On the lips colours decide, which `cv2.grabCut` learns. W x H pixels, S side of a crop in px.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from skimage.morphology import convex_hull_image, remove_small_objects

from dubbing.heads.comparison import EYES, Compared, H, W, to_face
from dubbing.preparation.matting.matting import dilate

USUAL = 2.5  # times what a place differs by in most frames
THIN = 1  # px to each side: what is thinner is an edge that does not fit
APART = 0.22  # of a logarithm: no skin differs by more
LIKE_SKIN = 12.0  # of a and b of CIELAB
NOSE = 0.2  # of the nose that is dark beside a dark cheek
SHADED = 18.0  # the same in the light of the face beside: shade is redder, what is grey lies 30 off
# Of L, 0 to 255: a, b and L + BLACK all grow with the cube root of the light.
BLACK = 16 * 255 / 100
LEAST = 0.03  # of the squared eye distance that must differ, beside the lips
LARGE = 0.1  # of it: what hides a face, and has its colours
AROUND, MOST = 2, 3  # in so many frames of those that near, or it is chance
WHILE, LASTING = 8, 0.4  # frames before and after, and share of them in which a thing is there
ROUNDS = 3  # of grabCut
SOFT = 1.0  # px at 512, the edge of a mask
FADED, WHOLE = 0.05, 0.3  # of a coarse mask, where a fine one ends and is 1: the edge lies outside
BITE, STRIP = 3, 1  # px of the frame of the face: what a shine bites off, and a gap of the lips
RAGGED = 2  # px of it by which a coarse mask may extend beyond a fine one
TOLD = 0.8  # of a piece in a fine mask: all of it is that thing, and the fine mask has its edges


def unexplained(compared: Compared, usual: np.ndarray) -> np.ndarray:
    """Pixels (H, W) bool beside the lips that the head does not explain; none where few are.

    Args:
        usual: (H, W), by how much places differ in most frames.
    """
    beyond = (compared.apart > np.maximum(APART, USUAL * usual)) & compared.known
    kernel = np.ones((2 * THIN + 1,) * 2, np.uint8)
    solid = cv2.morphologyEx(beyond.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    small = LEAST * (EYES * compared.zoom) ** 2
    return np.asarray(remove_small_objects(solid, max_size=small, connectivity=2))


def is_large(compared: Compared, over: np.ndarray) -> bool:
    """Whether what surely lies over the face is more than a shade of a turned head."""
    return bool(over.sum() >= LARGE * (EYES * compared.zoom) ** 2)


def is_like_skin(compared: Compared, over: np.ndarray) -> bool:
    """Whether what lies over the face has its colours, as a hand has: no cut tells them apart."""
    lab, skin = _colours(compared, over)
    return skin is None or bool(np.linalg.norm(lab[1:] - skin[1:]) < LIKE_SKIN)


def is_shade(compared: Compared, over: np.ndarray, usual: np.ndarray) -> bool:
    """Whether what differs from the head is skin that a lamp leaves dark, all through a shot.

    Hair that falls over a cheek looks the same. But a lamp leaves a side of the nose dark, too.

    Args:
        usual: (H, W), by how much places differ in most frames.
    """
    lab, skin = _colours(compared, over)
    lasts = np.mean(usual[over] > APART) > 0.5
    of_nose = (over & compared.nose).sum() >= NOSE * max(1, compared.nose.sum())
    if skin is None or not (lasts and of_nose) or lab[0] > skin[0]:
        return False
    chroma, own = (colour[1:] / (colour[0] + BLACK) for colour in (lab, skin))
    return bool(np.linalg.norm(chroma - own) * (skin[0] + BLACK) < SHADED)


def _colours(compared: Compared, over: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Medians of L (0..255), a and b of a part (H, W) bool, and of the face beside it, if seen."""
    lab = cv2.cvtColor(compared.picture, cv2.COLOR_RGB2LAB).astype(np.float32) - (0, 128, 128)
    skin = compared.known & (compared.apart < APART / 2) & ~over
    return np.median(lab[over], 0), np.median(lab[skin], 0) if skin.any() else None


@dataclass
class Models:
    """Colours of what lies over a face and of what does not, as `cv2.grabCut` keeps them."""

    behind: np.ndarray
    over: np.ndarray


def cut_out(
    compared: Compared, seeds: np.ndarray, near: np.ndarray | None, models: Models | None
) -> tuple[np.ndarray, Models | None]:
    """All that lies over the face, (H, W) bool, and its colours.

    Args:
        seeds: (H, W) bool, what surely does.
        near: the same of the frame before, or after it, if that is known; with its colours.
    """
    cut = np.full((H, W), cv2.GC_PR_BGD, np.uint8)
    if near is not None:
        cut[near] = cv2.GC_PR_FGD
    cut[compared.known & (compared.apart < APART / 2)] = cv2.GC_BGD
    cut[compared.known & (compared.apart > APART)] = cv2.GC_PR_FGD
    if near is not None and not seeds.any():
        # What the frame beside shows, and the head does not explain here either, is there still.
        inner = cv2.erode(near.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        cut[inner & (compared.apart > APART)] = cv2.GC_FGD
    cut[seeds] = cv2.GC_FGD
    over = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if not over.any() or over.all() or not (cut == cv2.GC_BGD).any():
        return seeds, models
    of = Models(np.zeros((1, 65)), np.zeros((1, 65)))
    mode = cv2.GC_INIT_WITH_MASK
    if models is not None and not seeds.any():
        of, mode = Models(models.behind.copy(), models.over.copy()), cv2.GC_EVAL_FREEZE_MODEL
    cv2.setRNGSeed(0)
    cv2.grabCut(compared.picture, cut, (0, 0, W, H), of.behind, of.over, ROUNDS, mode)
    found = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8)
    _, piece = cv2.connectedComponents(found)
    root = seeds if near is None else seeds | near
    return np.isin(piece, np.setdiff1d(piece[root], 0)), of


def followed(compared: list[Compared], seeds: list[np.ndarray]) -> list[np.ndarray]:
    """Pixels that lie over the face in each of some frames in a row.

    A frame without seeds takes on what its neighbours show, as far as it has the same colours.
    """
    found: list[np.ndarray] = [s.copy() for s in seeds]
    for step in (1, -1):
        near, models = None, None
        for k in range(len(seeds))[::step]:
            over, models = cut_out(compared[k], seeds[k], near, models)
            found[k] = found[k] | over
            near = over if over.any() else None
            if near is None:
                models = None
    parts = zip(found, seeds, compared, strict=True)
    return with_those_around([whole(m, of.lips) | s for m, s, of in parts], compared)


def with_those_around(found: list[np.ndarray], compared: list[Compared]) -> list[np.ndarray]:
    """Masks (H, W) bool of frames in a row, with what most frames around show.

    On the lips only that stays which lasts: a mouth that is open for a moment, and as dark as a
    thing at it, is none of it.
    """
    flat = np.stack(found).reshape(len(found), -1).astype(np.float32)
    share = cv2.blur(flat, (1, 2 * WHILE + 1), borderType=cv2.BORDER_REPLICATE)
    lasts = (share >= LASTING).reshape(-1, H, W)
    return [
        np.where(of.lips, mask & dilate(there, 2), mask | there)
        for mask, of, there in zip(found, compared, lasts, strict=True)
    ]


def whole(mask: np.ndarray, lips: np.ndarray) -> np.ndarray:
    """A mask (H, W) bool without thin strips and, beside lips (H, W) bool, bites in its edge."""
    strip, bite = (
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2)
        for reach in (STRIP, BITE)
    )
    solid = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, strip)
    closed = cv2.morphologyEx(solid, cv2.MORPH_CLOSE, bite)
    return np.where(lips, solid, closed) > 0


def without_dents(piece: np.ndarray, compared: Compared) -> np.ndarray:
    """One thing (H, W) bool, with what within its convex hull differs from the head.

    A shine has other colours than the thing that it lies on, and a cut by colours leaves it out.
    """
    return piece | (convex_hull_image(piece) & (compared.apart > APART))


def beside_told(
    over: np.ndarray, told: np.ndarray, landmarks: np.ndarray, bare: np.ndarray
) -> np.ndarray:
    """The cut over the face, (H, W) bool, without pieces that the preparation has found, too.

    A cut in the frame of the face is coarse: beside a graphic it takes lips along. The rest of a
    piece that was found in part stays, as the band of a cup.

    Args:
        told: (S, S) uint8, the preparation's mask. landmarks: (478, 2) px of it.
        bare: (H, W) bool, see `bare_face`.
    """
    fine = cv2.warpAffine(told, to_face(landmarks), (W, H), flags=cv2.INTER_LINEAR) > 127
    fine = dilate(fine, RAGGED)
    _, pieces = cv2.connectedComponents(over.astype(np.uint8))
    size = np.bincount(pieces.ravel())
    inside = np.bincount(pieces[fine], minlength=len(size))
    found = over & (inside >= TOLD * size)[pieces]
    rest = dilate(found & ~fine & ~bare, RAGGED)
    return np.asarray((over & ~found) | (found & rest & ~bare))


def bare_face(compared: Compared) -> np.ndarray:
    """Pixels (H, W) bool that the head explains, and the lips: there words decide."""
    return compared.lips | (compared.known & (compared.apart < APART))


def steady(seeds: list[np.ndarray]) -> list[np.ndarray]:
    """Seeds without those of frames in whose neighbourhood few others have any."""
    some = np.array([s.any() for s in seeds], int)
    votes = np.convolve(some, np.ones(2 * AROUND + 1, int))[AROUND:][: len(seeds)]
    return [s if vote >= MOST else np.zeros_like(s) for s, vote in zip(seeds, votes, strict=True)]


def mask_of(over: np.ndarray, image: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Mask (S, S) uint8 of what lies over the face, with the edges of the picture.

    Args:
        over: (H, W) bool. image: (S, S, 3) uint8. landmarks: (478, 2) px of it.
    """
    size = len(image)
    back = cv2.invertAffineTransform(to_face(landmarks))
    wide = cv2.warpAffine(over.astype(np.float32), back, (size, size), flags=cv2.INTER_LINEAR)
    return on_edges(wide, image, float(np.hypot(*back[:, 0])))


def on_edges(mask: np.ndarray, image: np.ndarray, scale: float) -> np.ndarray:
    """A coarse mask (S, S), 0..1, laid on the edges of the picture (S, S, 3): (S, S) uint8.

    Args:
        scale: px of the picture to a px of the mask before it was enlarged.
    """
    fine = cv2.ximgproc.guidedFilter(image, mask, max(2, round(1.5 * scale)), 1e-3 * 255**2)
    soft = np.clip((fine - FADED) / (WHOLE - FADED), 0, 1)
    sigma = max(0.5, SOFT * len(image) / 512)
    return np.asarray((255 * cv2.GaussianBlur(soft, (0, 0), sigma)).round(), np.uint8)
