"""Shoulders and shirt: a distance field in the body frame, marched once for the whole clip.

The body frame equals the head frame at rest (cm, y up, z towards the viewer) and stays where it is
in front of the camera; only the neck bends between body and head.
"""

from dataclasses import dataclass

import numpy as np

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import (
    capsule,
    ellipsoid,
    outward,
    smooth_cut,
    smooth_min,
)
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep, value_noise
from dubbing.workshop.synthetic.rendering.camera import Camera
from dubbing.workshop.synthetic.rendering.shading import Lighting, Rig, develop, irradiance

SUPERSAMPLE = 2
FAR = 1.0e6


@dataclass(frozen=True)
class Plate:
    """Everything behind the head: colour (S, S, 3) 0..255, depth (S, S) cm, body (S, S) 0..1.

    fine_colour (2S, 2S, 3) and fine_depth (2S, 2S) are the same at twice the resolution.
    """

    colour: np.ndarray
    depth: np.ndarray
    body: np.ndarray
    fine_colour: np.ndarray
    fine_depth: np.ndarray


def _body(p: np.ndarray, grow: float) -> np.ndarray:
    """Chest, shoulders and arms; p (3, N) has x >= 0 (mirrored)."""
    d = ellipsoid(p, (0, -33.0, -3.0), (16.0 + grow, 19.0 + grow, 9.2 + grow))
    d = smooth_min(d, capsule(p, (5.0, -16.8, -3.6), (16.0, -19.2, -3.8), 3.2, 4.3), 4.0)
    d = smooth_min(d, capsule(p, (17.0, -20.0, -3.6), (20.0, -44.0, -2.0), 4.4, 4.6), 3.0)
    d = smooth_min(d, capsule(p, (2.5, -11.5, -4.6), (11.0, -17.0, -4.4), 2.6, 2.6), 4.0)
    return d - grow


def torso_distance(p: np.ndarray, face: Face) -> tuple[np.ndarray, np.ndarray]:
    """Distances (N,) to the shirt and to the skin of the chest at points (N, 3)."""
    m = np.stack([np.abs(p[:, 0]), p[:, 1], p[:, 2]]).astype(np.float32)
    skin = _body(m, -0.35)
    folds = 0.22 * np.sin(m[1] * 0.9 + 0.8 * m[0]) * smoothstep(-20, -26, m[1])
    shirt = _body(m, 0.25) + folds * smoothstep(8.0, 15.0, m[0])
    if face.shirt_style == "crew":
        hole = ellipsoid(m, (0, -11.5, -1.6), (6.9, 5.3, 7.9))
        shirt = smooth_cut(shirt, hole, 0.5)
        radius = np.hypot(m[0] / 1.02, m[2] + 2.0)
        rim_y = -14.1 - 0.23 * (m[2] + 2.0)
        ring = np.hypot(radius - 6.6, (m[1] - rim_y) * 0.75) - 0.42
        shirt = smooth_min(shirt, ring, 0.25)
    else:
        hole = ellipsoid(m, (0, -11.5, -1.4), (6.7, 4.9, 7.6))
        neckline = capsule(m, (0, -13.5, 5.5), (0, -19.5, 8.5), 2.6, 0.5)
        shirt = smooth_cut(smooth_cut(shirt, hole, 0.5), neckline, 0.3)
        shirt = smooth_min(shirt, _collar(m), 0.15)
    return shirt, skin


def _collar(m: np.ndarray) -> np.ndarray:
    """A folded shirt collar, open at the front."""
    radius = np.hypot(m[0], (m[2] + 2.1) * 0.93)
    drop = m[1] + 13.4 + 0.24 * (m[2] + 2.0)
    lean = 6.55 - 0.32 * drop
    band = np.maximum(np.abs(radius - lean) - 0.20, np.abs(drop) - 1.75) * 0.75
    gap = 1.7 + 0.55 * drop - m[0]
    opening = np.where(m[2] > 0, gap, -1.0)
    return np.maximum(band, opening) - 0.10


def shoot(
    camera: Camera, shift: np.ndarray, face: Face, room: np.ndarray, lighting: Lighting = "soft"
) -> Plate:
    """Body before the room (S, S, 3) 0..255, with the body's origin at shift (3,) cm."""
    size, n = camera.size, camera.size * SUPERSAMPLE
    first = int(n * 0.60)
    col, row = np.meshgrid(np.arange(n), np.arange(first, n))
    half = (SUPERSAMPLE - 1) / 2
    rays = camera.rays(((col - half) / SUPERSAMPLE).ravel(), ((row - half) / SUPERSAMPLE).ravel())
    origin = -shift
    length, hit = _march(origin, rays, face)
    p = origin + rays[hit] * length[hit][:, None]
    shirt, skin = torso_distance(p, face)
    cloth = shirt < skin
    normal = outward(lambda at: np.minimum(*torso_distance(at, face)), p, 0.08)
    noise = value_noise((n - first, n), (int(n * 0.05), int(n * 0.07)), face.seed + 9).ravel()[hit]
    normal = normal + 0.05 * noise[:, None] * np.array([1.0, 0.6, 0.0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rig = Rig.turned(np.eye(3), lighting)
    shadow, occlusion = _shadow(p + 0.3 * normal, rig.key, face), _head_occlusion(p)
    weave = value_noise((n - first, n), ((n - first) // 2, n // 2), face.seed + 8).ravel()[hit]
    fabric = np.asarray(face.shirt) * (1.0 + 0.05 * weave[:, None])
    albedo = np.where(cloth[:, None], fabric, np.asarray(face.skin))
    wrap = np.where(cloth[:, None], 0.12, np.array([0.34, 0.17, 0.11]))
    light = albedo * irradiance(normal, occlusion, shadow, rig, wrap)
    facing = 1.0 + np.einsum("ij,ij->i", normal, rays[hit])
    light += (0.035 * cloth * np.clip(facing, 0, 1) ** 3)[:, None]
    return _assemble(room, develop(light), length * -rays[:, 2], hit, first=first, size=size)


def _assemble(
    room: np.ndarray,
    colour: np.ndarray,
    depth: np.ndarray,
    hit: np.ndarray,
    *,
    first: int,
    size: int,
) -> Plate:
    n, s = size * SUPERSAMPLE, SUPERSAMPLE
    big = np.repeat(np.repeat(room.astype(np.float64), s, 0), s, 1)
    lower = big[first:].reshape(-1, 3)
    lower[hit] = colour
    big[first:] = lower.reshape(n - first, n, 3)
    far = np.full((n, n), FAR)
    far[first:] = np.where(hit, depth, FAR).reshape(n - first, n)
    blocks = far.reshape(size, s, size, s)
    body = (blocks < FAR).mean(axis=(1, 3))
    colour = big.reshape(size, s, size, s, 3).mean(axis=(1, 3))
    return Plate(colour, blocks.min(axis=(1, 3)), body, big, far)


def _march(origin: np.ndarray, rays: np.ndarray, face: Face) -> tuple[np.ndarray, np.ndarray]:
    """Ray lengths (N,) and which rays hit (N,) bool."""
    length = np.full(len(rays), 55.0)
    alive = np.arange(len(rays))
    hit = np.zeros(len(rays), bool)
    for _ in range(64):
        p = origin + rays[alive] * length[alive][:, None]
        d = np.minimum(*torso_distance(p, face))
        length[alive] += 0.8 * d
        hit[alive[d < 0.03]] = True
        alive = alive[(d >= 0.03) & (length[alive] < 110.0)]
        if len(alive) == 0:
            break
    return length, hit


def _shadow(p: np.ndarray, direction: np.ndarray, face: Face) -> np.ndarray:
    """Soft shadow of head, neck and body (after Quilez: the narrowest cone that gets through)."""
    reach, lit = np.full(len(p), 0.4), np.ones(len(p))
    for _ in range(22):
        q = p + direction * reach[:, None]
        d = np.minimum(np.minimum(*torso_distance(q, face)), _head(q))
        lit = np.minimum(lit, np.clip(0.5 + 0.5 * 7.0 * d / reach, 0.0, 1.0))
        reach += np.clip(d, 0.5, 4.0)
    return smoothstep(0.0, 1.0, lit)


def _head(q: np.ndarray) -> np.ndarray:
    q = q.T
    head = ellipsoid(q, (0, 1.8, 0.0), (6.9, 10.6, 9.0))
    return np.minimum(head, capsule(q, (0, -4, -2), (0, -15, -3), 4.4, 4.4))


def _head_occlusion(p: np.ndarray) -> np.ndarray:
    """How much of the sky the head leaves free."""
    below = np.exp(-((p[:, 0] / 9.0) ** 2) - ((p[:, 1] + 12.0) / 6.5) ** 2)
    return 1.0 - 0.6 * below
