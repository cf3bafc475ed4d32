"""Faces that are found where there are none: made meshes in the place of FaceMesh."""

from __future__ import annotations

from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from tests.dubbing.sync.meshes import canonical, turned

MIDDLE = (16.0, 12.0)  # px, between the eyes


class MadeFaces:
    """Finds one mesh after the other, whatever the picture."""

    def __init__(self, meshes: np.ndarray) -> None:
        self._meshes = iter(meshes)

    def restart(self) -> None:
        pass

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        return [next(self._meshes)]


def show_faces(
    patch: pytest.MonkeyPatch, module: ModuleType, talks: list[np.ndarray], scale: float
) -> None:
    """Each FaceMesh that a module opens finds the next of some talks (F, 478, 3).

    Args:
        scale: px of an eye distance.
    """
    left = iter(talks)

    def opened(**_: object) -> MadeFaces:
        return MadeFaces(turned(next(left), 0.0, scale, MIDDLE))

    face = SimpleNamespace(numpy=canonical)
    patch.setattr(module, "FaceMesh", opened)
    patch.setattr(module, "load_network", lambda: SimpleNamespace(face=face))
