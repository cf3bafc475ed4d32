"""A made face mesh with a mouth, for tests that need no pixels."""

import numpy as np

from dubbing.face.mouth.mouth_shape import CHIN, EYE_CORNERS, INNER_LIP, MOUTH, OUTER_LIP, RIGID

POINTS = 478


def made_mesh() -> np.ndarray:
    """Points (478, 3) of a bowl-shaped face, outer eye corners 1 apart, right, down, away."""
    rng = np.random.default_rng(7)
    mesh = rng.uniform(-0.8, 0.8, (POINTS, 3))
    mesh[:, 1] -= 0.3
    mesh[:, 2] = 0.4 * (mesh[:, 0] ** 2 + mesh[:, 1] ** 2)
    mesh[EYE_CORNERS[0]] = [-0.5, 0, 0]
    mesh[EYE_CORNERS[1]] = [0.5, 0, 0]
    return mesh


def talk(opening: np.ndarray, width: np.ndarray | float = 0.5) -> np.ndarray:
    """Meshes (T, 478, 3) whose mouth is open by `opening` (T,) and `width` wide."""
    meshes = np.repeat(made_mesh()[None], len(opening), 0)
    half = np.broadcast_to(np.asarray(width, float), opening.shape) / 2
    for ring, thickness in ((OUTER_LIP, 0.08), (INNER_LIP, 0.0)):
        # Lower lip first: from the right corner along the bottom to the left one and back.
        for k, point in enumerate(ring):
            angle = np.pi - 2 * np.pi * k / len(ring)
            height = np.where(np.sin(angle) > 0, opening / 2, opening / 2) + thickness
            meshes[:, point, 0] = half * np.cos(angle)
            meshes[:, point, 1] = 0.7 + height * np.sin(angle)
            meshes[:, point, 2] = 0.1
    for k, point in enumerate(CHIN):
        meshes[:, point, 0] = 0.02 * k
        meshes[:, point, 1] = 1.0 + opening
        meshes[:, point, 2] = 0.2
    return meshes


def canonical() -> np.ndarray:
    """The canonical face the made meshes are laid on, (K, 3)."""
    return made_mesh()[list(RIGID)].astype(np.float32)


def turned(meshes: np.ndarray, yaw: float, scale: float, shift: tuple[float, float]) -> np.ndarray:
    """The meshes under a head turned by `yaw` radians, `scale` pixels an eye distance."""
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return meshes @ turn.T * scale + np.array([*shift, 0.0])


assert not set(MOUTH) & set(RIGID), "the alignment must not see the mouth"
