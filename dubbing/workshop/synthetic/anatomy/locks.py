"""Locks of hair: tapered strips along centre lines."""

from dataclasses import dataclass, replace

import numpy as np

ACROSS = 4  # vertices across a lock


@dataclass(frozen=True)
class Hair:
    """Vertices (V, 3), normals, tangents (V, 3), strand coordinate (V, 2) and shade (V,).

    The strand coordinate is across a lock (with a random start) and along it (0 root, 1 tip).
    """

    vertices: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray
    strand: np.ndarray
    shade: np.ndarray
    triangles: np.ndarray

    def with_more(self, other: "Hair") -> "Hair":
        """This hair and another."""
        more = replace(other, triangles=other.triangles + len(self.vertices))
        pairs = zip(vars(self).values(), vars(more).values(), strict=True)
        return Hair(*(np.concatenate(pair) for pair in pairs))

    @staticmethod
    def none() -> "Hair":
        """No hair at all."""
        none = np.zeros((0, 3))
        return Hair(none, none, none, none[:, :2], none[:, 0], np.zeros((0, 3), np.int32))


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)


def strips(
    path: np.ndarray,
    normal: np.ndarray,
    half_width: float,
    rng: np.random.Generator,
    across: int = ACROSS,
) -> Hair:
    """Locks along centre lines path (N, K, 3) with outward normals (N, K, 3)."""
    count, along = len(path), path.shape[1]
    tangent = unit(np.gradient(path, axis=1))
    aside = unit(np.cross(tangent, normal))
    out = np.cross(aside, tangent)
    t = np.linspace(0.0, 1.0, along)
    width = (
        half_width
        * rng.uniform(0.7, 1.3, count)[:, None]
        * ((0.35 + 0.65 * np.sin(np.pi * np.clip(t * 0.85 + 0.1, 0, 1))) * (1 - 0.85 * t**4))
    )
    phi = np.linspace(np.pi, 0.0, across)
    bend, rise = np.cos(phi), np.sin(phi)
    w = width[:, :, None, None]
    vertices = (
        path[:, :, None]
        + aside[:, :, None] * w * bend[:, None]
        + out[:, :, None] * w * (0.42 * rise - 0.20)[:, None]
    )
    normals = out[:, :, None] * (0.35 + rise)[:, None] + aside[:, :, None] * 0.8 * bend[:, None]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    shape = (count, along, across)
    start = rng.uniform(0, 50, count)[:, None, None]
    strand = np.stack(
        [
            np.broadcast_to(start + width[:, :, None] * bend * 1.0, shape),
            np.broadcast_to(t[None, :, None], shape),
        ],
        axis=-1,
    )
    shade = rng.uniform(0.72, 1.28, count)[:, None, None] * (0.45 + 0.55 * t[None, :, None] ** 0.5)
    shade = shade * (0.62 + 0.38 * rise)
    index = np.arange(count * along * across).reshape(shape)
    a, b = index[:, :-1, :-1].ravel(), index[:, :-1, 1:].ravel()
    c, d = index[:, 1:, 1:].ravel(), index[:, 1:, :-1].ravel()
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Hair(
        vertices.reshape(-1, 3),
        normals.reshape(-1, 3),
        np.broadcast_to(tangent[:, :, None], vertices.shape).reshape(-1, 3).copy(),
        strand.reshape(-1, 2),
        shade.reshape(-1),
        triangles.astype(np.int32),
    )
