"""Looks of a face, and the distance between the looks of two people.

A face is described by the shape of its rigid points in its own frame, and by mean and spread of the
colours of its parts: NaN of a part that lies outside of the picture, as the forehead of a close-up
does. Colours are compared as they are; and their lightness alone, in one light: night, a lamp or a
grade change that of all parts alike. N faces, D numbers each.
"""

import cv2
import numpy as np
from skimage.transform import estimate_transform

from dubbing.face.mesh_points import LEFT_EYE_OUTER, NOSE_BASE, RIGHT_EYE_OUTER, RIGID
from dubbing.face.mouth.similarity import similarity
from dubbing.preparation.tracking.procrustes import head_frame

# A face further than this from all people is assigned to none. One in a hundred pairs of different
# people is nearer.
FARTHEST = 1.8
SIDE = 96  # px of the upright face that colours are read from
ANCHORS = np.array([[0.2, 0.3], [0.8, 0.3], [0.5, 0.62]]) * SIDE  # outer eye corners, nose
# Parts of the upright face, shares of its side: x and y of the middle, half width, half height.
PARTS = (
    (0.5, 0.5, 0.36, 0.42),  # face
    (0.5, 0.06, 0.3, 0.06),  # hair or forehead
    (0.5, 0.2, 0.33, 0.08),  # brows
    (0.25, 0.55, 0.07, 0.1),  # cheeks
    (0.75, 0.55, 0.07, 0.1),
    (0.5, 0.92, 0.15, 0.07),  # chin
    (0.5, 0.75, 0.12, 0.05),  # mouth
)
# Scale of the differences, mostly those between frames of one person.
SHAPE_SCALE = 0.0102  # units of 10 cm; meshes of small faces are rough
COLOUR_SCALE = np.array([8.9, 2.1, 2.2, 5.2, 1.1, 0.7])  # L, a, b: means, then spreads
UNLIKE = 9.0  # mean square of a part's differences: beyond, a caption or a hand lies over it
# A distance of lightness counts so many times: less is left to tell people apart by. Of 2,070
# pairs of different people 1.2 % are then nearer than `FARTHEST`, as without it. Of 46 people in a
# dimmed, warm, faded, pale or colourless picture 80 to 83 % are, and 0 to 7 % without it.
LIGHTNESS = 2.0
LEAST_GAIN, MOST_GAIN = 0.25, 4.0  # of a light's contrast
STEADY = 50.0  # levels squared: keeps the gain of a flat face
LEAST_SEEN = 0.5  # share of a part's pixels that a picture shows, and of faces that show a part


def looks(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Looks (D,) of the face with mesh points (478, 3) px of an RGB image."""
    try:
        shape = head_frame(points.astype(np.float64))[list(RIGID)]
    except np.linalg.LinAlgError:  # something that only looked like a face
        shape = np.zeros((len(RIGID), 3))
    motion = _upright(points)
    upright, shown = (
        cv2.warpAffine(whole, motion, (SIDE, SIDE), flags=cv2.INTER_AREA)
        for whole in (image, np.full(image.shape[:2], 255, np.uint8))
    )
    colours = cv2.cvtColor(upright, cv2.COLOR_RGB2LAB).astype(np.float64)
    figures = [shape.ravel()]
    for x, y, wide, high in PARTS:
        rows = slice(round((y - high) * SIDE), round((y + high) * SIDE))
        columns = slice(round((x - wide) * SIDE), round((x + wide) * SIDE))
        seen = shown[rows, columns] == 255
        part = colours[rows, columns][seen]
        known = seen.mean() >= LEAST_SEEN
        figures += [part.mean(0), part.std(0)] if known else [np.full(6, np.nan)]
    return np.concatenate(figures)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Distance of the looks (N, D) of two people, from the medians of each.

    Parts are compared that most faces of both show.
    """
    split = 3 * len(RIGID)
    first, second = _usual(one), _usual(other)
    target, moved = (figures[:split].reshape(1, -1, 3) for figures in (first, second))
    shape = (similarity(moved, target[0])(moved) - target) / SHAPE_SCALE
    own, others = (figures[split:].reshape(-1, 6) for figures in (first, second))
    as_seen = (own - others) / COLOUR_SCALE
    distances = [
        times * float(np.sqrt((shape**2).mean() + _mean_square(colours)))
        for times, colours in ((1.0, as_seen), (LIGHTNESS, _in_one_light(own, others)))
    ]
    return min(distances)


def _mean_square(colours: np.ndarray) -> float:
    """Of differences (parts, C), each part's no more than `UNLIKE`."""
    parts = np.minimum((colours**2).mean(1), UNLIKE)
    known = parts[np.isfinite(parts)]
    return float(known.mean() if len(known) else UNLIKE)


def _in_one_light(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Differences (parts, 2) of lightness and of its spread, in the light of more contrast.

    A light is a gain and an offset, by least squares.

    Args:
        one, other: (parts, 6) colours of two faces.
    """
    own, others = (colours[:, [0, 3]] for colours in (one, other))
    known = np.isfinite(own[:, 0]) & np.isfinite(others[:, 0])
    if not known.any():
        return np.full_like(own, np.nan)
    middle, away = own[known, 0].mean(), others[known, 0].mean()
    apart, of = own[known, 0] - middle, others[known, 0] - away
    gain = np.clip((apart @ of + STEADY) / (of @ of + STEADY), LEAST_GAIN, MOST_GAIN)
    relit = np.stack([middle + gain * (others[:, 0] - away), gain * others[:, 1]], 1)
    return np.asarray((own - relit) / COLOUR_SCALE[[0, 3]] / min(gain, 1))


def _usual(looks: np.ndarray) -> np.ndarray:
    """Median looks (D,) of faces (N, D), NaN of parts that fewer than half of them show."""
    known = np.isfinite(looks).mean(0) >= LEAST_SEEN
    return np.where(known, np.nanmedian(np.where(known, looks, 0), 0), np.nan)


def _upright(points: np.ndarray) -> np.ndarray:
    """The (2, 3) least-squares similarity that maps eyes and nose to `ANCHORS`."""
    seen = points[[LEFT_EYE_OUTER, RIGHT_EYE_OUTER, NOSE_BASE], :2].astype(np.float64)
    found = estimate_transform("similarity", seen, ANCHORS)
    return np.asarray(found.params[:2]) if found else np.eye(2, 3)  # all points in one place
