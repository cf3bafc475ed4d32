"""How mouth parameters move the skin: jaw, lips, rounding, closure.

Weights are computed once from the rest positions; a frame is then a few multiplications.
"""

from dataclasses import dataclass

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_HALF_WIDTH, MOUTH_Y
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep

HINGE = np.array([0.0, -0.4, 0.4])  # the axis of the jaw, along x, in front of the ears
JAW_DEGREES = 13.0  # at jaw = 1


@dataclass(frozen=True)
class MouthShape:
    """Mouth parameters of one frame, 0..1 (wide: -1 round to 1 spread). See `visemes`."""

    jaw: float = 0.0
    part: float = 0.0
    wide: float = 0.0
    protrude: float = 0.0
    press: float = 0.0
    tuck: float = 0.0
    tongue: float = 0.0


class LipWeights:
    """How much each of V rest positions (V, 3) follows the jaw and the lips.

    `lower` (V,) bool: vertices below the mouth line.
    """

    def __init__(self, rest: np.ndarray, lower: np.ndarray, face: Face) -> None:
        x, y, z = np.abs(rest[:, 0]), rest[:, 1] - MOUTH_Y, rest[:, 2]
        half = MOUTH_HALF_WIDTH * face.mouth_width
        corner = np.clip(x / half, 0.0, 1.0) ** 2.6  # 0 in the middle, 1 from the corners on
        front = smoothstep(2.0, 6.0, z)
        reach = 2.4 + 0.5 * x
        shared = 0.5 * corner * (1.0 - smoothstep(0.0, 1.0, np.abs(y) / reach))
        jaw = np.where(lower, 1.0 - shared, shared)
        self.jaw = jaw * smoothstep(-1.2, 3.2, z)
        near = np.exp(-((y / 0.95) ** 2)) * front
        side = np.where(lower, -0.62, 0.42)
        self.part = 0.62 * side * (1.0 - corner) * near
        around = np.exp(-((x / 3.1) ** 2) - (y / 2.3) ** 2) * front
        self.wide = rest[:, 0] * around
        self.back = 0.30 * np.clip(x / half, 0.0, 1.3) ** 2 * around  # lips bend round the teeth
        self.protrude = np.exp(-((x / 1.9) ** 2) - (y / 1.25) ** 2) * front
        self.press = -y * np.exp(-((y / 0.62) ** 2)) * np.exp(-((x / 2.6) ** 2)) * front
        rolled = np.exp(-((y / 0.5) ** 2)) * np.exp(-((x / 2.2) ** 2)) * front
        self.roll = rolled
        self.tuck = np.where(lower, 1.0, 0.0) * np.exp(-((y / 0.75) ** 2)) * (1 - corner) * front
        self.smile = smoothstep(0.3, 1.0, x / half) * np.exp(
            -(((x - half) / 1.6) ** 2) - (y / 1.5) ** 2
        )
        self.moved = (self.jaw + self.wide**2 + self.protrude + np.abs(self.part)) > 1e-3

    def apply(self, rest: np.ndarray, shape: MouthShape) -> np.ndarray:
        """Vertices (V, 3) of a mouth shape."""
        out = rest.copy()
        spread = 0.17 * max(shape.wide, 0.0) + 0.36 * min(shape.wide, 0.0)
        out[:, 0] += spread * self.wide
        out[:, 1] += shape.part * self.part + 0.30 * shape.press * self.press
        out[:, 1] += 0.30 * shape.tuck * self.tuck + 0.10 * max(shape.wide, 0.0) * self.smile
        out[:, 2] += 0.62 * shape.protrude * self.protrude - 0.13 * shape.press * self.roll
        out[:, 2] -= 0.34 * shape.tuck * self.tuck + max(shape.wide, 0.0) * self.back
        return turn_jaw(out, self.jaw * shape.jaw)


def turn_jaw(points: np.ndarray, amount: np.ndarray | float) -> np.ndarray:
    """Points (V, 3) turned down about the hinge by amount (V,) of JAW_DEGREES."""
    angle = np.radians(JAW_DEGREES) * np.asarray(amount)
    c, s = np.cos(angle), np.sin(angle)
    dy, dz = points[:, 1] - HINGE[1], points[:, 2] - HINGE[2]
    return np.stack([points[:, 0], HINGE[1] + c * dy - s * dz, HINGE[2] + s * dy + c * dz], axis=1)
