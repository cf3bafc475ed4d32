"""Stores the images that a person is learned from: in memory, or in memory-mapped files.

T frames, S the crop's side in pixels.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dubbing.engine.disk.files import make_folder, writing


class ImageStore:
    """Stores the images of one frame after the other; `tensors` returns all of them.

    Args:
        shapes: name -> shape of all images of a kind, (T, S, S) or (T, S, S, 3).
        folder: for their files, one a kind; images stay in memory when None. Existing files are
            replaced. They must stay as long as the tensors are used.
    """

    def __init__(self, shapes: dict[str, tuple[int, ...]], folder: Path | None) -> None:
        self._shapes, self._folder = shapes, folder
        self._count = 0
        self._in_memory = {}
        if folder is None:
            self._in_memory = {
                name: torch.empty(shape, dtype=torch.uint8) for name, shape in shapes.items()
            }
            return
        make_folder(folder)
        for path in (folder / name for name in shapes):
            with writing(path):
                path.unlink(missing_ok=True)

    def add(self, **images: np.ndarray) -> None:
        """Adds the images (S, S) or (S, S, 3) uint8 of the next frame, one of each kind.

        Raises:
            ExplainedError: they cannot be written, as on a full disk.
        """
        for name, image in images.items():
            if self._folder is None:
                self._in_memory[name][self._count] = torch.from_numpy(image)
                continue
            path = self._folder / name
            with writing(path), open(path, "ab") as file:
                file.write(np.ascontiguousarray(image).data)
        self._count += 1

    def tensors(self) -> dict[str, Tensor]:
        """Name -> images of all frames, uint8. Changes to them are not written to the files."""
        if self._folder is None:
            return self._in_memory
        return {
            name: torch.from_file(
                str(self._folder / name), size=math.prod(shape), dtype=torch.uint8
            ).view(shape)
            for name, shape in self._shapes.items()
        }
