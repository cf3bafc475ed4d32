"""Faces seen in frames of a video, kept in a file by all that each frame's depend on.

P = 478 points of the face mesh, R rows and C columns of a crop.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from dubbing.engine.disk.files import atomic_path
from dubbing.face.finding.face_tracker import Meshes
from dubbing.face.mesh_points import LANDMARKS
from dubbing.face.mouth.mouth_crop import COLUMNS, ROWS


@dataclass
class KeptFaces:
    """Faces in frames.

    Attributes:
        meshes: of the faces in a frame, by its key.
        mouths: crops (R, C) uint8, by the key of the frame and the number of the face in it.
    """

    meshes: dict[str, Meshes] = field(default_factory=dict)
    mouths: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read what `write` kept."""
        with np.load(file, allow_pickle=False) as kept:
            keys, counts, meshes = (kept[name] for name in ("keys", "counts", "meshes"))
            mouths = zip(map(str, kept["mouth_keys"]), kept["mouths"], strict=True)
            parts = np.split(meshes, np.cumsum(counts)[:-1])
            return cls({str(k): list(p) for k, p in zip(keys, parts, strict=True)}, dict(mouths))

    def write(self, file: Path) -> None:
        """Keep it in a file."""
        meshes = [mesh for faces in self.meshes.values() for mesh in faces]
        with atomic_path(file) as temporary:
            np.savez(
                temporary,
                keys=np.array(list(self.meshes), str),
                counts=np.array([len(faces) for faces in self.meshes.values()], int),
                meshes=np.reshape(meshes, (-1, LANDMARKS, 3)).astype(np.float32),
                mouth_keys=np.array(list(self.mouths), str),
                mouths=np.reshape(list(self.mouths.values()), (-1, ROWS, COLUMNS)).astype(np.uint8),
            )
