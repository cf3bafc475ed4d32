"""Grids of vertices, and the triangles and normals that a renderer needs.

A patch is a grid of vertices (rows, columns, 3). Normals come from central differences on the
grid, which costs far less than averaging face normals and is done for every frame.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Patch:
    """One grid: where its vertices begin in the common arrays, its size, and its neighbours.

    with `wrap` the last column meets the first; `flip` turns the normals round.
    """

    first: int
    rows: int
    columns: int
    part: int
    wrap: bool = False
    flip: bool = False

    @property
    def last(self) -> int:
        return self.first + self.rows * self.columns

    def triangles(self) -> np.ndarray:
        """(M, 3) int32 vertex indices, counter-clockwise seen from outside."""
        index = np.arange(self.first, self.last).reshape(self.rows, self.columns)
        if self.wrap:
            index = np.concatenate([index, index[:, :1]], axis=1)
        a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
        c, d = index[1:, 1:].ravel(), index[1:, :-1].ravel()
        both = np.concatenate([np.stack([a, d, b], -1), np.stack([d, c, b], -1)])
        return (both[:, ::-1] if self.flip else both).astype(np.int32)

    def normals(self, vertices: np.ndarray) -> np.ndarray:
        """(rows * columns, 3) unit normals of this patch within vertices (V, 3)."""
        grid = vertices[self.first : self.last].reshape(self.rows, self.columns, 3)
        return grid_normals(grid, self.wrap, self.flip).reshape(-1, 3)


def grid_normals(grid: np.ndarray, wrap: bool = False, flip: bool = False) -> np.ndarray:
    """Unit normals of a grid (rows, columns, 3): rows go down, columns right, normal to the eye."""
    down = np.empty_like(grid)
    down[1:-1] = grid[2:] - grid[:-2]
    down[0], down[-1] = grid[1] - grid[0], grid[-1] - grid[-2]
    right = np.empty_like(grid)
    right[:, 1:-1] = grid[:, 2:] - grid[:, :-2]
    if wrap:
        right[:, 0], right[:, -1] = grid[:, 1] - grid[:, -1], grid[:, 0] - grid[:, -2]
    else:
        right[:, 0], right[:, -1] = grid[:, 1] - grid[:, 0], grid[:, -1] - grid[:, -2]
    n = np.cross(down, right)
    if flip:
        n = -n
    return n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-12)


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below low, 1 above high, a cubic in between (low may exceed high)."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def value_noise(shape: tuple[int, int], cells: tuple[int, int], seed: int) -> np.ndarray:
    """Smooth noise of zero mean and about unit range: a random grid of `cells`, interpolated."""
    import cv2

    rng = np.random.default_rng(seed)
    coarse = rng.standard_normal((cells[0] + 3, cells[1] + 3)).astype(np.float32)
    return cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
