"""The pictures that a person is learned from: in memory, or in files of which only what is looked
at is in memory.

T frames, S the crop's side in pixels.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from dubbing.files import make_folder, writing


class PictureStore:
    """Takes the pictures of one frame after the other; `tensors` gives all of them.

    Args:
        shapes: name -> shape of all pictures of a kind, (T, S, S) or (T, S, S, 3).
        folder: where their files lie, one a kind; they are kept in memory when None. Files that
            are there are replaced. They must stay as long as the tensors are used.
    """

    def __init__(self, shapes: dict[str, tuple[int, ...]], folder: Path | None) -> None:
        self._shapes, self._folder = shapes, folder
        self._taken = 0
        self._held = {}
        if folder is None:
            self._held = {name: torch.empty(s, dtype=torch.uint8) for name, s in shapes.items()}
            return
        make_folder(folder)
        for path in (folder / name for name in shapes):
            with writing(path):
                path.unlink(missing_ok=True)

    def add(self, **pictures: np.ndarray) -> None:
        """Takes the pictures (S, S) or (S, S, 3) uint8 of the next frame, one of each kind.

        Raises:
            DubbingError: they cannot be written, as on a full disk.
        """
        for name, picture in pictures.items():
            if self._folder is None:
                self._held[name][self._taken] = torch.from_numpy(picture)
                continue
            path = self._folder / name
            with writing(path), open(path, "ab") as file:
                file.write(np.ascontiguousarray(picture).data)
        self._taken += 1

    def tensors(self) -> dict[str, Tensor]:
        """Name -> pictures of all frames, uint8. What is changed in them reaches no file."""
        if self._folder is None:
            return self._held
        return {
            name: torch.from_file(
                str(self._folder / name), size=math.prod(shape), dtype=torch.uint8
            ).view(shape)
            for name, shape in self._shapes.items()
        }
