"""The skin as a grid: the distance field traced once along azimuth and elevation.

Rays run from outside towards a centre at the height of the mouth, so that the mouth line is one
row. That row exists twice, once for each lip.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_Y, head_distance

CENTRE = np.array([0.0, MOUTH_Y, 1.0])
OUTSIDE = 24.0  # cm from the centre, beyond every head


@dataclass(frozen=True)
class SkinGrid:
    """Rest positions (rows, columns, 3) and the row of the mouth line (first row of the lower lip).

    The last column meets the first at the back of the head.
    """

    points: np.ndarray
    mouth_row: int


def _spread(low: float, high: float, spacing: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Angles from low to high whose local distance is about spacing(angle), both ends included."""
    fine = np.linspace(low, high, 4000)
    density = 1.0 / spacing(fine)
    count = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(fine))])
    steps = max(2, round(float(count[-1])))
    return np.interp(np.linspace(0.0, count[-1], steps + 1), count, fine)


def _elevations() -> tuple[np.ndarray, np.ndarray]:
    """Degrees, descending: above the mouth line (ends at 0) and below it (begins at 0)."""

    def above(e: np.ndarray) -> np.ndarray:
        face = 1.15 - 0.45 * np.exp(-((e / 9.0) ** 2)) - 0.25 * np.exp(-(((e - 45) / 7.0) ** 2))
        return face + 2.0 * np.clip((e - 58.0) / 20.0, 0.0, 1.0)

    def below(e: np.ndarray) -> np.ndarray:
        face = 1.2 - 0.5 * np.exp(-((e / 9.0) ** 2))
        return face + 2.5 * np.clip((-e - 38.0) / 20.0, 0.0, 1.0)

    return _spread(0.0, 89.0, above)[::-1], _spread(-86.0, 0.0, below)[::-1]


def _azimuths() -> np.ndarray:
    def spacing(a: np.ndarray) -> np.ndarray:
        side = np.abs(a)
        face = 1.25 - 0.30 * np.exp(-((side / 16.0) ** 2))
        return face + 4.0 * np.clip((side - 52.0) / 30.0, 0.0, 1.0)

    half = _spread(0.0, 180.0, spacing)
    return np.concatenate([-half[::-1], half[1:-1]])


def trace(
    distance: Callable[[np.ndarray], np.ndarray], origin: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Ray lengths (N,) to the first surface along direction (N, 3) from origin (N, 3)."""
    length = np.zeros(len(origin))
    alive = np.arange(len(origin))
    for _ in range(90):
        step = 0.75 * distance(origin[alive] + direction[alive] * length[alive, None])
        length[alive] += step
        alive = alive[np.abs(step) > 1e-4]
        if len(alive) == 0:
            break
    return length


@lru_cache(maxsize=4)
def skin_grid(face: Face) -> SkinGrid:
    """The traced skin of a face. Rows run from the crown down, columns from left to right."""
    upper, lower = _elevations()
    elevation = np.radians(np.concatenate([upper, lower[1:]]))
    azimuth = np.radians(_azimuths())
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    outward = np.stack([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)], axis=-1)
    rays = outward.reshape(-1, 3)
    start = CENTRE + rays * OUTSIDE
    length = trace(lambda p: head_distance(p, face), start, -rays)
    points = (start - rays * length[:, None]).reshape(outward.shape)
    return SkinGrid(points, len(upper) - 1)
