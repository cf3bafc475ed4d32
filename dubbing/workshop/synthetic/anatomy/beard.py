"""Beard and moustache: short locks rooted in the skin, carried by the vertex they grow from."""

from dataclasses import dataclass

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_HALF_WIDTH, MOUTH_Y
from dubbing.workshop.synthetic.anatomy.locks import Hair, strips, unit
from dubbing.workshop.synthetic.anatomy.mesh import grid_normals, smoothstep
from dubbing.workshop.synthetic.anatomy.skin_grid import SkinGrid

ACROSS, ALONG = 3, 5  # vertices across and along a lock
WIDTH = 0.17  # cm, half of a lock
JITTER = 0.07  # cm
BELOW = np.array([0.0, -1.0, 0.12])

# The beard's upper edge as a height over z, and its back edge as z over the height (cm).
_TOP_Z, _TOP_Y = (0.3, 1.9, 3.0, 4.5, 6.0, 7.2, 9.0), (3.0, 0.8, -2.0, -3.0, -3.5, -3.5, -3.7)
_BACK_Y, _BACK_Z = (-10.0, -7.0, -5.0, -2.0, 3.0), (2.0, 1.6, 0.6, 0.4, 0.5)


@dataclass(frozen=True)
class Beard:
    """Locks at rest, and for each of their vertices the skin vertex whose motion it follows."""

    hair: Hair
    roots: np.ndarray


def beard_cover(p: np.ndarray, face: Face) -> np.ndarray:
    """Signed depth (cm, positive inside) of skin points (..., 3) in the beard."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    top = np.interp(z, _TOP_Z, _TOP_Y) - y
    back = z - np.interp(y, _BACK_Y, _BACK_Z)
    above = (y - MOUTH_Y) / np.where(y > MOUTH_Y, 0.9, 1.05 * face.lip_fullness + 0.15)
    lips = 1.1 * (np.hypot(x / (MOUTH_HALF_WIDTH * face.mouth_width + 0.3), above) - 1.0)
    return np.minimum(np.minimum(top, back), np.where(z > 5.0, lips, 9.0))


def moustache_cover(p: np.ndarray, face: Face) -> np.ndarray:
    """Signed depth (cm, positive inside) of skin points (..., 3) in the moustache."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    half = MOUTH_HALF_WIDTH * face.mouth_width
    middle = -2.92 - 0.16 * (face.lip_fullness - 1.0) - 0.10 * x**2
    thick = 0.50 - 0.10 * np.exp(-((x / 0.25) ** 2))
    return np.minimum(np.minimum(thick - np.abs(y - middle), half + 0.6 - x), z - 6.5)


def grow_beard(face: Face, grid: SkinGrid) -> Beard:
    """The locks of both; none for a face that has neither."""
    rng = np.random.default_rng(face.seed + 78)
    points, normals = grid.points.reshape(-1, 3), grid_normals(grid.points, wrap=True)
    normals = normals.reshape(-1, 3)
    steps = np.cross(np.gradient(grid.points, axis=0), np.gradient(grid.points, axis=1))
    area = np.linalg.norm(steps, axis=-1).ravel()
    roots, paths = [], []
    for length, cover, comb, density, rise in (
        (face.beard, beard_cover, _comb_beard, 17.0, (0.25, 0.65)),
        (face.moustache, moustache_cover, _comb_moustache, 34.0, (0.08, 0.30)),
    ):
        depth = cover(points, face) if length > 0 else np.full(len(points), -1.0)
        share = area * (depth > 0)
        count = round(density * share.sum())
        if count == 0:
            continue
        chosen = rng.choice(len(points), size=count, p=share / share.sum())
        reach = length * (0.45 + 0.55 * smoothstep(0.0, 1.0, depth[chosen] / min(1.0, length)))
        reach *= rng.uniform(0.6, 1.4, count)
        p, n = points[chosen] + rng.normal(0, JITTER, (count, 3)), normals[chosen]
        roots.append(chosen)
        paths.append(_path(p, n, comb(p, rng), reach, rng.uniform(*rise, count)))
    if not roots:
        return Beard(Hair.none(), np.zeros(0, np.int64))
    chosen, path = np.concatenate(roots), np.concatenate(paths)
    normal = np.repeat(normals[chosen][:, None], ALONG, axis=1)
    hair = strips(path, normal, WIDTH, rng, across=ACROSS)
    # The row of the mouth line stands twice in the vertices of the head.
    columns = grid.points.shape[1]
    vertex = chosen + columns * (chosen >= (grid.mouth_row + 1) * columns)
    return Beard(hair, np.repeat(vertex, ALONG * ACROSS))


def _comb_beard(p: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.broadcast_to(BELOW, p.shape) + rng.normal(0, 0.22, p.shape)


def _comb_moustache(p: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    aside = np.tanh(p[:, 0] / 0.35)
    comb = np.stack([0.95 * aside, -0.55 - 0.1 * np.abs(p[:, 0]), 0.0 * aside], axis=1)
    return comb + rng.normal(0, 0.12, p.shape)


def _path(
    p: np.ndarray, n: np.ndarray, comb: np.ndarray, length: np.ndarray, rise: np.ndarray
) -> np.ndarray:
    """Centre lines (N, ALONG, 3): they leave the skin at the slope `rise` and bend down."""
    flow = unit(comb - np.einsum("ij,ij->i", comb, n)[:, None] * n)
    p = p - 0.05 * n
    lines = [p]
    for k in range(1, ALONG):
        t = k / (ALONG - 1)
        d = unit(flow + (rise * (1.3 - t))[:, None] * n + 0.5 * t * BELOW)
        p = p + d * (length / (ALONG - 1))[:, None]
        lines.append(p)
    return np.stack(lines, axis=1)
