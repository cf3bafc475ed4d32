"""The seam of a dub along the jaw: edges at the rendered chin, and where the film's chin was.

A jaw that closes uncovers neck that the film never showed. What goes wrong there is a second chin:
an edge where the film's chin was, beside that of the rendered one. S side of the crop in px.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import astuple, dataclass

import cv2
import numpy as np

from dubbing.face.mesh_points import JAW, LEFT_EYE_OUTER, RIGHT_EYE_OUTER

CHIN_LINE = JAW[4:13]  # the part of the jaw's line round which all may change, see `face_mask`
HALF_BAND = 0.04  # eye distances to either side of a line; a collar may be three times as far
APART = 2  # half bands: from there on, the bands of the two chins do not overlap
NOT_KNOWN = float("nan")


@dataclass(frozen=True)
class ChinFigures:
    """Gradient energy, summed over pixels: of the dub and of the film's own frame along both chins;
    and along the film's chin alone, where the rendered one is elsewhere."""

    chin: float = NOT_KNOWN
    source_chin: float = NOT_KNOWN
    old_chin: float = NOT_KNOWN
    source_old_chin: float = NOT_KNOWN


def chin_figures(
    dub: np.ndarray, film: np.ndarray, dub_points: np.ndarray, film_points: np.ndarray
) -> ChinFigures:
    """Figures of one frame.

    Args:
        dub, film: the finished frame and the film's own, (S, S, 3) uint8.
        dub_points, film_points: landmarks (478, 2) of the dub and of the film.
    """
    eyes = float(np.linalg.norm(film_points[LEFT_EYE_OUTER] - film_points[RIGHT_EYE_OUTER]))
    half = max(1.0, HALF_BAND * eyes)
    size = len(dub)
    to_dub, to_film = (
        distance_to_line(x[list(CHIN_LINE)], size) for x in (dub_points, film_points)
    )
    both = (to_dub <= half) | (to_film <= half)
    old = (to_film <= half) & (to_dub > APART * half)
    dubbed, own = gradient_energies(dub), gradient_energies(film)
    return ChinFigures(*(float(e[where].sum()) for where in (both, old) for e in (dubbed, own)))


def chin_ratios(frames: Iterable[ChinFigures]) -> dict[str, float]:
    """`chin_ratio`, aims at 1, above it there are two chins; `old_chin_ratio`, aims at 0.

    The latter is how much of the film's chin still stands where the dub's is elsewhere; 1 is all of
    it. Energies of all frames are added up before they are divided. One of nothing is left out.
    """
    known = np.array([astuple(x) for x in frames]).reshape(-1, 4)
    made, own, made_old, own_old = known[np.isfinite(known).all(1)].sum(0)
    ratios = {}
    if own > 0:
        ratios["chin_ratio"] = float(made / own)
    if own_old > 0:
        ratios["old_chin_ratio"] = float(made_old / own_old)
    return ratios


def distance_to_line(points: np.ndarray, size: int) -> np.ndarray:
    """Distance (S, S) px of every pixel to the line through points (P, 2)."""
    away = np.full((size, size), 255, np.uint8)
    cv2.polylines(away, [points.round().astype(np.int32)], False, 0)
    return cv2.distanceTransform(away, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def gradient_energies(image: np.ndarray) -> np.ndarray:
    """Squared gradient (S, S) of the luminance, 0..1, of (S, S, 3) uint8; 0 at the far edges."""
    grey = image.astype(np.float64) @ np.array([0.299, 0.587, 0.114]) / 255
    energy = np.zeros_like(grey)
    energy[:, :-1] += np.diff(grey, axis=1) ** 2
    energy[:-1] += np.diff(grey, axis=0) ** 2
    return energy
