"""In which frames something covers the lower face: its colours are not those it usually has.

Colours are read at the points of the mesh, which stays where the mouth must be when a hand lies
over it, and compared in the light of each frame. T frames, P = 478 points.
"""

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from dubbing.face.mesh_points import NOSE_BASE, NOSE_BRIDGE, RIGID
from dubbing.face.mouth_shape import INNER_LIP
from dubbing.preparation.tracking.light import Light, coarse_gain, light_of, sampled

HALF_WIDTH = 0.42  # units of 10 cm from the middle of the face: beyond, cheeks turn away
DARK = 8.0  # added to colours (0..255) before their logarithm: noise of dark ones counts less
UNUSUAL = 3.0  # times as far from its median colour as the point mostly is, at least that of
LEAST_SPREAD = 0.06  # of a logarithm
SHARE = 0.35  # of the lower face that is unusual where something covers it
AROUND = 2  # frames before and after that are covered in part
OWN_FRAMES = 25  # of a shot that has a light of its own; a shorter one is compared with the clip


def covered_step(
    crops: Iterable[np.ndarray],
    points: np.ndarray,
    valid: np.ndarray,
    segment: np.ndarray,
    shape: np.ndarray,
    progress: Callable[[float], None],
) -> dict[str, np.ndarray]:
    """Frames in which the lower face is covered, or lit as no gain and offset explain.

    Args:
        crops: (S, S, 3) RGB of all frames.
        points: (T, P, 2 or more) px of the crop. valid: (T,) bool, they are known.
        segment: (T,) number of the shot. shape: (P, 3) in the head frame.

    Returns:
        covered (T,) bool; gain and offset (T, 3) of the light, see :class:`Light`.
    """
    colours = np.zeros((len(points), len(shape), 3), np.float32)
    level = np.zeros((len(points), 3))
    for t, image in enumerate(crops):
        colours[t], level[t] = sampled(image, points[t]), image[::8, ::8].mean((0, 1))
        progress((t + 1) / len(points))
    share = np.zeros(len(points))
    gain, offset = np.ones((len(points), 3)), np.zeros((len(points), 3))
    for shot in np.unique(segment):
        own = valid & (segment == shot)
        reference = own if own.sum() >= OWN_FRAMES else valid
        if own.any():
            share[own], light = unusual_share(colours[own], colours[reference], shape)
            gain[own], offset[own] = light.gain, light.offset
            unseen = (segment == shot) & ~valid
            gain[unseen] = coarse_gain(level[unseen], np.median(level[own], 0))
    seen = (share > SHARE).astype(np.uint8)
    for shot in np.unique(segment):
        part = segment == shot
        seen[part] = cv2.dilate(seen[part][None], np.ones((1, 2 * AROUND + 1), np.uint8))[0]
    return {"covered": (seen > 0) & valid, "gain": gain, "offset": offset}


def unusual_share(
    colours: np.ndarray, reference: np.ndarray, shape: np.ndarray
) -> tuple[np.ndarray, Light]:
    """Share (T,) of the lower face's points whose colour is far from what it usually is.

    And the light of the frames.

    Args:
        colours: (T, P, 3). reference: (U, P, 3), of frames most of which nothing covers.
        shape: (P, 3) in the head frame.
    """
    lower, upper = regions(shape)
    usual = np.median(reference, 0)
    usual = np.median(light_of(reference, usual, upper).unlit(reference), 0)

    def away(of: np.ndarray, light: Light) -> np.ndarray:
        there = np.log(np.maximum(of[:, lower], 0) + DARK)
        wanted = np.log(np.maximum(light.lit(usual[lower]), 0) + DARK)
        return np.asarray(np.linalg.norm(there - wanted, axis=2))

    apart = away(reference, light_of(reference, usual, upper))
    spread = np.maximum(1.4826 * np.median(apart, 0), LEAST_SPREAD)
    light = light_of(colours, usual, upper)
    return np.asarray((away(colours, light) > UNUSUAL * spread).mean(1)), light


def regions(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the lower face, without the inner mouth; and those that light is read from."""
    down = shape[:, 1]
    below = (down > down[NOSE_BASE]) & (np.abs(shape[:, 0]) < HALF_WIDTH)
    below[list(INNER_LIP)] = False
    rigid = np.zeros(len(shape), bool)
    rigid[list(RIGID)] = True
    return np.flatnonzero(below), np.flatnonzero(rigid & ~below & (down > down[NOSE_BRIDGE]))
