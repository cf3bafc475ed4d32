"""Light and how skin, hair, eyes, teeth and cloth answer it. Linear RGB; N points.

Directions are unit vectors. Light directions are given in camera axes (x right, y up, z towards
the viewer) and turned into the frame of the points by the caller.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Light:
    """A far light: direction towards it (3,), colour (3,)."""

    direction: np.ndarray
    colour: np.ndarray


def _unit(*v: float) -> np.ndarray:
    a = np.asarray(v, dtype=np.float64)
    return a / np.linalg.norm(a)


def _colour(*rgb: float) -> np.ndarray:
    return np.asarray(rgb, dtype=np.float32)


KEY = Light(_unit(-0.55, 0.52, 0.72), _colour(2.15, 1.98, 1.78))
FILL = Light(_unit(0.85, 0.12, 0.60), _colour(0.36, 0.43, 0.52))
RIM = Light(_unit(0.70, 0.45, -0.62), _colour(1.15, 1.20, 1.30))
SKY, GROUND = _colour(0.50, 0.54, 0.60), _colour(0.26, 0.21, 0.18)
UP = np.array([0.0, 1.0, 0.0])
SKIN_WRAP = np.array([0.34, 0.17, 0.11])  # red light travels furthest under the skin
EXPOSURE = 0.80
CATCH_EDGE = 0.965  # cosine of the half angle of the soft box


Lighting = Literal["soft", "side"]
# Direction towards the key light, and the share of every other light that is left.
LIGHTINGS: dict[Lighting, tuple[np.ndarray, float]] = {
    "soft": (KEY.direction, 1.0),
    "side": (_unit(-0.95, 0.15, 0.25), 0.22),
}


@dataclass(frozen=True)
class Rig:
    """The lights turned into the frame of the points (rotation: camera axes to that frame).

    `rest` is the share of the lights other than the key light.
    """

    rest: float
    key: np.ndarray
    fill: np.ndarray
    rim: np.ndarray
    up: np.ndarray

    @staticmethod
    def turned(rotation: np.ndarray, lighting: Lighting = "soft") -> "Rig":
        key, rest = LIGHTINGS[lighting]
        directions = (key, FILL.direction, RIM.direction, UP)
        return Rig(rest, *((rotation @ d).astype(np.float32) for d in directions))


def irradiance(
    n: np.ndarray, occlusion: np.ndarray, shadow: np.ndarray, rig: Rig, wrap: np.ndarray
) -> np.ndarray:
    """Diffuse light (N, 3) on normals n (N, 3); shadow is 1 where the key light arrives.

    wrap (N, 3) lets light bend round the terminator, per colour.
    """

    def lambert(direction: np.ndarray, soft: np.ndarray) -> np.ndarray:
        return np.clip(((n @ direction)[:, None] + soft) / (1.0 + soft), 0.0, None)

    # The shadow edge is tinted like the terminator: red bleeds furthest into it.
    bleed = shadow[:, None] ** (1.0 - 0.75 * wrap)
    light = KEY.colour * lambert(rig.key, wrap) * bleed
    open_sky = rig.rest * occlusion[:, None]
    light += FILL.colour * lambert(rig.fill, wrap + 0.15) * open_sky
    light += RIM.colour * lambert(rig.rim, wrap * 0.5) * open_sky
    half = (0.5 + 0.5 * (n @ rig.up))[:, None]
    # Deep places are reddish, not grey.
    tinted = rig.rest * occlusion[:, None] ** (1.0 - 0.5 * wrap)
    return (light + (GROUND + half * (SKY - GROUND)) * tinted) * 0.5


def highlights(
    n: np.ndarray,
    ray: np.ndarray,
    *,
    strength: np.ndarray,
    power: np.ndarray | float,
    shadow: np.ndarray,
    rig: Rig,
) -> np.ndarray:
    """Blinn highlights (N, 3) of the three lights with a Fresnel factor (Schlick, f0 = 0.03)."""
    out = np.zeros((len(n), 3), np.float32)
    view = -ray
    facing = np.clip(np.einsum("ij,ij->i", n, view), 0.0, 1.0)
    grazing = (1.0 - facing) ** 5
    lights = ((rig.key, KEY, shadow), (rig.fill, FILL, rig.rest), (rig.rim, RIM, 0.6 * rig.rest))
    for direction, light, reach in lights:
        h = view + direction
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        lobe = np.clip(np.einsum("ij,ij->i", n, h), 0.0, 1.0) ** power
        lit = np.clip(n @ direction * 4.0, 0.0, 1.0)
        fresnel = 0.03 + 0.97 * (1.0 - np.clip(np.einsum("ij,ij->i", view, h), 0, 1)) ** 5
        scale = strength * (np.asarray(power) + 8.0) / 25.0 * fresnel * lobe * lit * reach
        out += scale[:, None] * light.colour
    return out + (strength * 0.10 * rig.rest * grazing)[:, None] * SKY


def catchlight(n: np.ndarray, ray: np.ndarray, rig: Rig) -> np.ndarray:
    """The mirror image of the key light's soft box on a wet eye, (N, 3)."""
    mirrored = ray - 2.0 * np.einsum("ij,ij->i", n, ray)[:, None] * n
    toward = mirrored @ rig.key
    spot = np.clip((toward - CATCH_EDGE) / 0.02, 0.0, 1.0)
    return 0.9 * spot[:, None] * KEY.colour


def hair_highlights(
    tangent: np.ndarray, ray: np.ndarray, colour: np.ndarray, shadow: np.ndarray, rig: Rig
) -> np.ndarray:
    """Kajiya-Kay: a sharp white and a broad coloured lobe along the strand, (N, 3)."""
    out = np.zeros((len(tangent), 3), np.float32)
    behind = 0.8 * rig.rest + 0 * shadow
    for direction, light, reach in ((rig.key, KEY, shadow), (rig.rim, RIM, behind)):
        h = direction - ray
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        cosine = np.einsum("ij,ij->i", tangent, h)
        sine = np.sqrt(np.clip(1.0 - cosine**2, 0.0, 1.0))
        white, tinted = 0.030 * sine**90, 0.55 * sine**22
        out += reach[:, None] * light.colour * (white[:, None] + tinted[:, None] * colour)
    return out


def develop(linear: np.ndarray) -> np.ndarray:
    """Linear light to display values 0..255 (float): film curve (fit by Narkowicz), then sRGB."""
    x = np.clip(linear * EXPOSURE, 0.0, None)
    x = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    return 255.0 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
