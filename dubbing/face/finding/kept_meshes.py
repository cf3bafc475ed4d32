"""Meshes of faces in frames of a video, kept in a file by all that each frame's depend on.

P = 478 points of the face mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dubbing.engine.disk.files import atomic_path
from dubbing.face.mesh_points import LANDMARKS

Meshes = list[np.ndarray]  # of the faces in a frame, each (P, 3) float32


def read(file: Path) -> dict[str, Meshes]:
    """Read the meshes that `write` kept, by the keys of their frames."""
    with np.load(file, allow_pickle=False) as kept:
        keys, counts, meshes = (kept[name] for name in ("keys", "counts", "meshes"))
    parts = np.split(meshes, np.cumsum(counts)[:-1])
    return {str(key): list(part) for key, part in zip(keys, parts, strict=True)}


def write(file: Path, found: Mapping[str, Meshes]) -> None:
    """Write the meshes of frames, by their keys."""
    meshes = [
        np.zeros((0, LANDMARKS, 3), np.float32),
        *(m[None] for f in found.values() for m in f),
    ]
    with atomic_path(file) as temporary:
        np.savez(
            temporary,
            keys=np.array(list(found)),
            counts=np.array([len(faces) for faces in found.values()]),
            meshes=np.concatenate(meshes),
        )
