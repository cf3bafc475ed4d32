"""Eyes, drawn where the skin is open: an almond cut into the lids, an eyeball behind it.

The eyeball is intersected analytically per ray. A blink lowers the upper lid curve.
"""

from dataclasses import dataclass

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import EYE, EYE_HALF_WIDTH, EYE_RADIUS
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep

IRIS = 0.66  # cm
BALL = EYE_RADIUS - 0.02
REACH_DEGREES = 35.0  # how far eyes turn from straight ahead


@dataclass(frozen=True)
class EyeSurface:
    """Surface of the lids and the eyeball at the rays of one batch near an eye."""

    open: np.ndarray  # (N,) bool: the ray sees the eyeball
    albedo: np.ndarray  # (N, 3)
    normal: np.ndarray  # (N, 3) of the cornea
    occlusion: np.ndarray  # (N,) shade of the lids on the ball
    lash: np.ndarray  # (N,) 0..1 lashes and lid edge on the skin
    crease: np.ndarray  # (N,) 0..1 fold of the upper lid on the skin


def lid_curves(u: np.ndarray, blink: float, opening: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights (cm, from the eye's centre) of the upper and lower lid edge at u.

    u runs from -1 at the inner to 1 at the outer corner; the lids meet at both.
    """
    inside = np.clip(1.0 - u * u, 0.0, 1.0)
    tilt = 0.06 * u
    lower = -0.37 * opening * inside**0.85 * (1.0 + 0.18 * u) + tilt
    upper = 0.50 * opening * inside**0.72 * (1.0 - 0.10 * u) + tilt
    return lower + (upper - lower) * (1.0 - blink), lower


def within_reach(gaze: np.ndarray) -> np.ndarray:
    """Unit view directions (2, 3) in the head frame, turned back to what eyes can do."""
    limit = np.radians(REACH_DEGREES)
    aside = gaze[:, :2] / np.maximum(np.linalg.norm(gaze[:, :2], axis=1, keepdims=True), 1e-9)
    nearest = np.concatenate([np.sin(limit) * aside, np.full((2, 1), np.cos(limit))], axis=1)
    return np.where(gaze[:, 2:] < np.cos(limit), nearest, gaze)


def near_eye(p: np.ndarray) -> np.ndarray:
    """(N,) bool: skin points near an eye, for which `look` is needed."""
    side = np.abs(np.abs(p[:, 0]) - EYE[0])
    return (side < 1.75) & (np.abs(p[:, 1] - EYE[1]) < 1.35) & (p[:, 2] > 4.5)


def look(
    p: np.ndarray,
    origin: np.ndarray,
    ray: np.ndarray,
    *,
    gaze: np.ndarray,
    blink: float,
    face: Face,
) -> EyeSurface:
    """Eyes at skin points p (N, 3) seen along ray (N, 3) from origin (3,); gaze is (2, 3).

    gaze holds unit vectors in the head frame, for the eye at -x and at +x.
    """
    side = np.sign(p[:, 0])
    u = (np.abs(p[:, 0]) - EYE[0]) / EYE_HALF_WIDTH
    v = p[:, 1] - EYE[1]
    # The lids follow eyes that look far down.
    down = np.degrees(np.arcsin(np.clip(-gaze[:, 1].mean(), -1, 1)))
    follow = float(smoothstep(14.0, 36.0, down))
    upper, lower = lid_curves(np.clip(u, -1, 1), max(blink, 0.55 * follow), face.eye_opening)
    lower = lower - 0.16 * follow * (1.0 - blink) * np.clip(1.0 - u * u, 0.0, 1.0)
    is_open = (v < upper) & (v > lower) & (np.abs(u) < 1.0)
    centre = np.stack([side * EYE[0], np.full_like(side, EYE[1]), np.full_like(side, EYE[2])], 1)
    point = _ball(origin, ray, centre)
    normal = point - centre
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    axis = np.where(side[:, None] < 0, gaze[0], gaze[1])
    albedo, normal = _iris(normal, axis, face)
    corner = smoothstep(0.62, 0.98, -u)
    albedo += corner[:, None] * (np.array([0.42, 0.16, 0.13]) - albedo)
    shade = smoothstep(-0.06, 0.36, upper - v) * 0.62 + 0.38
    shade *= smoothstep(-0.05, 0.16, v - lower) * 0.35 + 0.65
    shade *= 1.0 - 0.35 * smoothstep(0.6, 1.0, np.abs(u))
    return EyeSurface(
        is_open, albedo, normal, shade, _lashes(u, v, upper, lower), _crease(u, v, face)
    )


def _ball(origin: np.ndarray, ray: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Where rays meet the eyeball, or its nearest point to the ray where they miss it."""
    to = centre - origin
    along = np.einsum("ij,ij->i", to, ray)
    apart = np.einsum("ij,ij->i", to, to) - along**2
    return origin + ray * (along - np.sqrt(np.maximum(BALL**2 - apart, 0.0)))[:, None]


def _iris(n: np.ndarray, axis: np.ndarray, face: Face) -> tuple[np.ndarray, np.ndarray]:
    cosine = np.clip(np.einsum("ij,ij->i", n, axis), -1, 1)
    r = np.arccos(cosine) * BALL / IRIS  # 1 at the edge of the iris
    across = n - axis * cosine[:, None]
    angle = np.arctan2(across[:, 1], across[:, 0])
    streaks = 0.5 + 0.3 * np.sin(angle * 23.0 + np.sin(angle * 7)) + 0.2 * np.sin(angle * 41 + 1.3)
    sclera = np.array([0.66, 0.60, 0.57]) * (1.0 - 0.12 * smoothstep(1.2, 2.2, r))[:, None]
    tone = (0.75 + 0.7 * streaks * smoothstep(0.25, 0.75, r)) * (1.25 - 0.35 * r)
    iris = np.asarray(face.eyes) * 1.15 * tone[:, None]
    iris *= (1.0 - 0.80 * smoothstep(0.78, 1.0, r))[:, None]
    pupil = smoothstep(0.40, 0.33, r)
    iris *= (1.0 - 0.97 * pupil)[:, None]
    white = smoothstep(0.93, 1.07, r)[:, None]
    cornea = n + 0.28 * across * smoothstep(1.2, 0.6, r)[:, None]
    cornea /= np.linalg.norm(cornea, axis=1, keepdims=True)
    return iris + white * (sclera - iris), cornea


def _lashes(u: np.ndarray, v: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    width = 0.075 + 0.06 * smoothstep(-0.5, 1.0, u)
    along = smoothstep(1.16, 0.98, np.abs(u - 0.06))
    above = v - upper
    line = smoothstep(1.7, 0.5, above / width) * (above > -0.02) * along
    below = lower - v
    fine = 0.45 * smoothstep(0.085, 0.01, below) * (below > -0.02) * along
    return np.maximum(line, fine * smoothstep(-0.8, 0.6, u))


def _crease(u: np.ndarray, v: np.ndarray, face: Face) -> np.ndarray:
    open_upper, _ = lid_curves(np.clip(u * 0.92, -1, 1), 0.0, face.eye_opening)
    d = v - (open_upper + 0.26)
    return np.exp(-((d / 0.075) ** 2)) * smoothstep(1.2, 0.8, np.abs(u))
