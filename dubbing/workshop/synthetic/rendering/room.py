"""The room behind the speaker, out of focus: a wall, a window, a shelf, a lamp."""

import cv2
import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.mesh import value_noise
from dubbing.workshop.synthetic.rendering.shading import develop


def room(size: int, face: Face) -> np.ndarray:
    """Background (size, size, 3) as display values 0..255 (float)."""
    n = 512
    rng = np.random.default_rng(face.seed + 5)
    y, x = np.mgrid[0:n, 0:n] / n
    wall = np.asarray(face.room)
    light = wall * (0.75 + 0.5 * (1 - x) + 0.25 * (1 - y))[..., None]
    light *= (1.0 + 0.03 * value_noise((n, n), (9, 9), face.seed + 6))[..., None]
    _window(light, rng)
    _shelf(light, rng)
    light = cv2.GaussianBlur(light, (0, 0), 7.0)
    _lamp(light, x, y, face, rng)
    light = cv2.GaussianBlur(light, (0, 0), 4.0)
    light = cv2.resize(light, (size, size), interpolation=cv2.INTER_AREA)
    grain = np.random.default_rng(face.seed + 7).normal(0.0, 0.9, (size, size, 1))
    return np.clip(develop(light * 1.05) + grain, 0.0, 255.0)


def _window(light: np.ndarray, rng: np.random.Generator) -> None:
    left, top = int(rng.integers(18, 50)), int(rng.integers(20, 50))
    width, height = 120, 215
    cv2.rectangle(light, (left - 8, top - 8), (left + width + 8, top + height + 8), (0.5,) * 3, -1)
    for i in range(2):
        for j in range(3):
            x0, y0 = left + i * (width // 2 + 2), top + j * (height // 3 + 2)
            tone = (0.80 - 0.10 * j, 0.92 - 0.10 * j, 1.05 - 0.12 * j)
            cv2.rectangle(light, (x0, y0), (x0 + width // 2 - 4, y0 + height // 3 - 4), tone, -1)


def _shelf(light: np.ndarray, rng: np.random.Generator) -> None:
    for top in (150, 250, 350):
        cv2.rectangle(light, (372, top), (512, top + 9), (0.10, 0.06, 0.035), -1)
        x = 376
        while x < 505:
            width, height = int(rng.integers(8, 20)), int(rng.integers(42, 78))
            if rng.random() < 0.85:
                tone = tuple(float(c) for c in rng.uniform(0.05, 0.25) * rng.uniform(0.6, 1.4, 3))
                cv2.rectangle(light, (x, top - height), (x + width, top), tone, -1)
            x += width + 2


def _lamp(
    light: np.ndarray, x: np.ndarray, y: np.ndarray, face: Face, rng: np.random.Generator
) -> None:
    cx, cy = float(rng.uniform(0.84, 0.9)), float(rng.uniform(0.10, 0.15))
    glow = np.exp(-(((x - cx) / 0.16) ** 2) - ((y - cy) / 0.14) ** 2)
    light += 0.35 * glow[..., None] * np.asarray(face.lamp)
    disc = ((x - cx) / 0.042) ** 2 + ((y - cy) / 0.042) ** 2 < 1
    light[disc] = np.asarray(face.lamp) * 1.6
