"""In which frames something covers the lower face: its colours are not those it usually has.

Colours are read at the points of the mesh, which stays where the mouth must be when a hand lies
over it. T frames, P = 478 points.
"""

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from dubbing.face.mesh_points import NOSE_BASE, NOSE_BRIDGE, RIGID
from dubbing.face.mouth_shape import INNER_LIP

HALF_WIDTH = 0.42  # units of 10 cm from the middle of the face: beyond, cheeks turn away
BLUR = 0.012  # of the face's width: landmarks jitter by that much
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
    """Frames in which the lower face is covered.

    Args:
        crops: (S, S, 3) RGB of all frames.
        points: (T, P, 2 or more) px of the crop. valid: (T,) bool, they are known.
        segment: (T,) number of the shot. shape: (P, 3) in the head frame.

    Returns:
        covered (T,) bool.
    """
    colours = np.zeros((len(points), len(shape), 3), np.float32)
    for t, image in enumerate(crops):
        colours[t] = sampled(image, points[t])
        progress((t + 1) / len(points))
    share = np.zeros(len(points))
    for shot in np.unique(segment):
        own = valid & (segment == shot)
        reference = own if own.sum() >= OWN_FRAMES else valid
        if own.any():
            share[own] = unusual_share(colours[own], colours[reference], shape)
    seen = (share > SHARE).astype(np.uint8)
    for shot in np.unique(segment):
        part = segment == shot
        seen[part] = cv2.dilate(seen[part][None], np.ones((1, 2 * AROUND + 1), np.uint8))[0]
    return {"covered": (seen > 0) & valid}


def sampled(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Logarithms of the colours (P, 3) of an RGB image at points (P, 2 or more) px."""
    smooth = cv2.GaussianBlur(image, (0, 0), max(0.6, BLUR * float(np.ptp(points[:, 0]))))
    x, y = points[None, :, 0].astype(np.float32), points[None, :, 1].astype(np.float32)
    read = cv2.remap(smooth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(np.log(read[0] + np.float32(DARK)))


def unusual_share(colours: np.ndarray, reference: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Share (T,) of the lower face's points whose colour is far from what it usually is.

    Args:
        colours: (T, P, 3) logarithms. reference: (U, P, 3), of frames most of which nothing covers.
        shape: (P, 3) in the head frame.
    """
    lower, upper = regions(shape)
    middle = np.median(reference, 0)
    middle = np.median(reference - gain(reference, middle, upper), 0)

    def away(of: np.ndarray) -> np.ndarray:
        lit = of - gain(of, middle, upper) - middle
        return np.asarray(np.linalg.norm(lit[:, lower], axis=2))

    spread = np.maximum(1.4826 * np.median(away(reference), 0), LEAST_SPREAD)
    return np.asarray((away(colours) > UNUSUAL * spread).mean(1))


def gain(colours: np.ndarray, middle: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """What light makes of all colours of a frame, (T, 1, 3), from those of the upper face."""
    return np.asarray(np.median((colours - middle)[:, upper], axis=1, keepdims=True))


def regions(shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the lower face, without the inner mouth; and those that light is read from."""
    down = shape[:, 1]
    below = (down > down[NOSE_BASE]) & (np.abs(shape[:, 0]) < HALF_WIDTH)
    below[list(INNER_LIP)] = False
    rigid = np.zeros(len(shape), bool)
    rigid[list(RIGID)] = True
    return np.flatnonzero(below), np.flatnonzero(rigid & ~below & (down > down[NOSE_BRIDGE]))
