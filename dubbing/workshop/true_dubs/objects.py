"""Objects in front of the face, and people behind it: drawn over rendered frames.

S side of the rendered frame in px; lengths are given for S = 320 and scale with it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.workshop.synthetic.anatomy.mesh import smoothstep, value_noise
from dubbing.workshop.true_dubs.scenes import DUBBED, LEARNED, RATE

UNIT = 320
LIGHT = np.array([-0.45, -0.55, 0.7])  # towards the key light: right, down, to the viewer
HAND_SKIN = (196.0, 142.0, 116.0)
# Of a hand with its fingers up, origin in the palm: from, to, and the radii there, px.
HAND = (
    ((0, 8), (0, -10), 24, 22),
    ((-15, -16), (-19, -52), 7.5, 6.0),
    ((-5, -20), (-6, -62), 7.8, 6.2),
    ((6, -20), (8, -59), 7.8, 6.2),
    ((16, -14), (22, -46), 7.0, 5.4),
    ((-18, 6), (-38, -16), 9.0, 6.8),
    ((0, 20), (6, 110), 17, 21),
)
HAND_TILT = 0.35  # rad
BELOW = 190.0  # px below the mouth, where the hand waits
# Seconds of the dubbed part: the hand rises, is there, and leaves.
RISES, THERE, LEAVES, GONE = 0.45, 0.75, 1.75, 2.05


@dataclass(frozen=True)
class Cover:
    """An object in a frame: its colour, premultiplied (S, S, 3), and its opacity (S, S) in 0..1."""

    colour: np.ndarray
    opacity: np.ndarray

    def over(self, image: np.ndarray) -> np.ndarray:
        """The frame (S, S, 3) uint8 with the object in front of it."""
        out = self.colour + (1 - self.opacity[..., None]) * image
        return np.clip(out.round(), 0, 255).astype(np.uint8)


def hand(t: int, mouth: np.ndarray, size: int) -> Cover:
    """A hand that is held before the mouth for a second.

    Args:
        t: frame. mouth: (2,) px, its middle.
    """
    seconds = t / RATE - LEARNED
    now = np.array(seconds)
    up = smoothstep(RISES, THERE, now) * smoothstep(GONE, LEAVES, now)
    unit = size / UNIT
    sway = 3 * np.sin(9 * seconds)
    place = mouth + unit * np.array([10 + sway, 12 + BELOW * (1 - float(up))])
    return solid(_hand_height(place, size), HAND_SKIN, 0.25)


def _hand_height(place: np.ndarray, size: int) -> np.ndarray:
    """Height (S, S) of the hand over the picture, px; 0 where there is none."""
    unit = size / UNIT
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    x, y = (x - place[0]) / unit, (y - place[1]) / unit
    c, s = np.cos(HAND_TILT), np.sin(HAND_TILT)
    x, y = c * x + s * y, -s * x + c * y
    height = np.zeros_like(x)
    for (ax, ay), (bx, by), ra, rb in HAND:
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        away = np.hypot(x - ax - along * dx, y - ay - along * dy)
        radius = ra + (rb - ra) * along
        np.maximum(height, np.sqrt(np.clip(radius**2 - away**2, 0, None)), out=height)
    return height * unit


def microphone(mouth: np.ndarray, size: int) -> Cover:
    """A microphone on a stand, whose head covers chin and lower lip.

    Args:
        mouth: (2,) px, where its middle is in the mean.
    """
    unit = size / UNIT
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    x, y = (x - mouth[0] - 9 * unit) / unit, (y - mouth[1] - 19 * unit) / unit
    ball = np.sqrt(np.clip(15.0**2 - x**2 - y**2, 0, None))
    stand = np.sqrt(np.clip(6.0**2 - (x - 0.22 * y) ** 2, 0, None)) * (y > 4)
    grid = 0.75 + 0.25 * np.sin(1.9 * x) * np.sin(1.9 * y)
    return solid(np.maximum(ball, stand) * unit, (74.0, 76.0, 82.0), 0.9, grid)


def solid(
    height: np.ndarray,
    colour: tuple[float, float, float],
    gloss: float,
    paint: np.ndarray | float = 1,
) -> Cover:
    """An object of a height (S, S) over the picture, lit by the key light."""
    down, right = np.gradient(height)
    normal = np.stack([-right, -down, np.ones_like(height)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = LIGHT / np.linalg.norm(LIGHT)
    facing = np.clip(normal @ light, 0, 1)
    shine = gloss * facing**24
    grain = 1 + 0.03 * value_noise(height.shape, (40, 40), 5)
    tone = (0.42 + 0.62 * facing) * grain * paint
    opacity = cv2.GaussianBlur(np.clip(height, 0, 1).astype(np.float32), (0, 0), 0.7)
    shaded = np.clip(np.asarray(colour) * tone[..., None] + 255 * shine[..., None], 0, 255)
    return Cover(shaded * opacity[..., None], opacity)


def passed_by(
    image: np.ndarray, person: np.ndarray, other: tuple[np.ndarray, np.ndarray], t: int
) -> np.ndarray:
    """The frame with another person who passes behind this one, from one side to the other.

    Args:
        image, person: frame and matte of the body of who stays.
        other: those of who passes.
        t: frame.
    """
    size = len(image)
    share = np.clip((t / RATE - LEARNED) / DUBBED, 0, 1)
    shift = np.array([[1, 0, (2 * share - 1) * 1.1 * size], [0, 1, 0.02 * size]])
    there, matte = (cv2.warpAffine(part, shift, (size, size)) for part in other)
    behind = matte[..., None] / 255 * (1 - person[..., None] / 255)
    return np.clip(image + behind * (there.astype(np.float32) - image), 0, 255).astype(np.uint8)
