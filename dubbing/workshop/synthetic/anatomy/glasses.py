"""Glasses: plastic frames round the eyes and temples to the ears, rigid with the head."""

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import EYE, head_distance
from dubbing.workshop.synthetic.anatomy.locks import unit

ROUND = 10  # vertices round a tube
RIM_CENTRE, RIM_HALF = (3.25, 2.75), (2.35, 1.75)  # cm
SQUARENESS = 4.0  # exponent of the superellipse of a rim
HINGE_Y, EAR_TOP_Y = 3.6, 3.3
CLEARANCE = 0.30  # cm between the temple's middle and the skin


def frames(face: Face) -> dict[str, np.ndarray]:
    """Grids (K, ROUND, 3) of tubes by name."""
    a = np.linspace(0.0, 2 * np.pi, 65)
    power = 2.0 / SQUARENESS
    x = RIM_CENTRE[0] + RIM_HALF[0] * np.sign(np.cos(a)) * np.abs(np.cos(a)) ** power
    y = RIM_CENTRE[1] + RIM_HALF[1] * np.sign(np.sin(a)) * np.abs(np.sin(a)) ** power
    rim = np.stack([x, y, _front(x, y)], axis=1)
    inner = RIM_CENTRE[0] - RIM_HALF[0]
    x = np.linspace(-inner, inner, 13)
    y = 3.15 + 0.25 * np.cos(np.pi / 2 * x / inner)
    bridge = np.stack([x, y, _front(x, y) + 0.1], axis=1)
    temple = _temple(face)
    tubes = {"bridge": _tube(bridge, (0.16, 0.16), np.array([0.0, 0.0, 1.0]))}
    for side in (-1.0, 1.0):
        mirror = np.array([side, 1.0, 1.0])
        tubes[f"rim{side:+.0f}"] = _tube(rim * mirror, (0.19, 0.15), np.array([0.0, 0.0, 1.0]))
        tubes[f"temple{side:+.0f}"] = _tube(temple * mirror, (0.22, 0.11), mirror * [1.0, 0.0, 0.0])
    return tubes


def _front(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Depth of the front of the glasses: bent round the face, the lower edge nearer to it."""
    return EYE[2] + 2.75 - 0.045 * x**2 + 0.08 * (y - RIM_CENTRE[1])


def _temple(face: Face) -> np.ndarray:
    """Centre line (K, 3) of the temple at +x, from the rim over the ear and down behind it."""
    outer = RIM_CENTRE[0] + RIM_HALF[0]
    start = float(_front(np.array(outer), np.array(HINGE_Y)))
    z = np.concatenate([np.linspace(start, -1.2, 25), [-1.9, -2.4, -2.7, -2.9]])
    y = np.concatenate([np.linspace(HINGE_Y, EAR_TOP_Y, 25), [3.0, 2.4, 1.7, 0.9]])
    p = np.stack([np.full_like(z, outer), y, z], axis=1)
    for _ in range(12):  # out of the head, sideways
        p[:, 0] += np.clip(CLEARANCE - head_distance(p, face), -0.4, 0.4)
        p[:, 0] = np.maximum(p[:, 0], outer)
    return p


def _tube(line: np.ndarray, radii: tuple[float, float], out: np.ndarray) -> np.ndarray:
    """A flat tube (K, ROUND, 3) along line (K, 3): radii across and along the direction `out`."""
    tangent = unit(np.gradient(line, axis=0))
    if np.allclose(line[0], line[-1]):
        tangent[0] = tangent[-1] = unit(tangent[0] + tangent[-1])
    aside = unit(np.cross(out, tangent))
    out = np.cross(tangent, aside)
    a = np.linspace(2 * np.pi, 0.0, ROUND + 1)[1:, None]
    return (
        line[:, None] + radii[0] * np.cos(a) * aside[:, None] + radii[1] * np.sin(a) * out[:, None]
    )
