"""The paint on the skin: colour, gloss and ambient occlusion as textures over the skin grid."""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.workshop.synthetic.anatomy.beard import beard_cover, moustache_cover
from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_HALF_WIDTH, MOUTH_Y, head_distance
from dubbing.workshop.synthetic.anatomy.mesh import grid_normals, smoothstep, value_noise
from dubbing.workshop.synthetic.anatomy.skin_grid import skin_grid

TEXELS = 7  # texels between two grid vertices


@dataclass(frozen=True)
class SkinTexture:
    """albedo (h, w, 3) linear RGB, gloss (h, w), occlusion (h, w), all float32.

    Texel (TEXELS * row, TEXELS * column) belongs to a vertex of the skin grid.
    """

    albedo: np.ndarray
    gloss: np.ndarray
    occlusion: np.ndarray


def paint(face: Face) -> SkinTexture:
    """The textures of a face."""
    grid = skin_grid(face).points.astype(np.float32)
    closed = np.concatenate([grid, grid[:, :1]], axis=1)
    rows, columns = closed.shape[:2]
    h, w = (rows - 1) * TEXELS + 1, (columns - 1) * TEXELS + 1
    col, row = np.meshgrid(np.arange(w), np.arange(h))
    p = cv2.remap(
        closed,
        (col / TEXELS).astype(np.float32),
        (row / TEXELS).astype(np.float32),
        cv2.INTER_LINEAR,
    )
    occlusion = _occlusion(closed, face, (w, h))
    albedo, gloss = _colour(p, face)
    return SkinTexture(albedo.astype(np.float32), gloss.astype(np.float32), occlusion)


def _occlusion(grid: np.ndarray, face: Face, size: tuple[int, int]) -> np.ndarray:
    """Ambient occlusion from the distance field along the normal (after Evans), per vertex."""
    normals = grid_normals(grid, wrap=False)
    total = np.zeros(grid.shape[:2], np.float32)
    for step in (0.3, 0.7, 1.4, 2.6):
        free = head_distance((grid + step * normals).reshape(-1, 3), face).reshape(total.shape)
        total += (np.clip(step - free, 0.0, step) / step * 0.32).astype(np.float32)
    return cv2.resize(np.clip(1.0 - total, 0.12, 1.0), size, interpolation=cv2.INTER_LINEAR)


def _colour(p: np.ndarray, face: Face) -> tuple[np.ndarray, np.ndarray]:
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    front = smoothstep(1.0, 5.0, z)
    skin = np.asarray(face.skin, np.float32)
    albedo = np.broadcast_to(skin, p.shape).copy()

    def tint(mask: np.ndarray, factor: tuple[float, float, float]) -> None:
        albedo[...] *= 1.0 + mask[..., None] * (np.asarray(factor) - 1.0)

    def spot(cx: float, cy: float, rx: float, ry: float) -> np.ndarray:
        return np.exp(-(((x - cx) / rx) ** 2) - ((y - cy) / ry) ** 2) * front

    blotch = value_noise(p.shape[:2], (34, 40), face.seed)
    pores = value_noise(p.shape[:2], (300, 340), face.seed + 1)
    albedo *= (1.0 + 0.028 * blotch + 0.022 * pores)[..., None]
    tint(spot(4.1, -0.9, 1.9, 1.6) * 0.8, (1.06, 0.80, 0.80))  # cheeks
    tint(spot(0.0, -0.6, 1.3, 1.1) * 0.7, (1.05, 0.82, 0.80))  # nose
    tint(spot(0.0, -7.9, 1.6, 1.2) * 0.4, (1.03, 0.86, 0.86))  # chin
    tint(spot(3.1, 1.55, 1.6, 0.55) * 0.55, (0.84, 0.76, 0.82))  # below the eyes
    tint(spot(3.2, 3.9, 1.5, 0.7) * 0.5, (0.88, 0.80, 0.80))  # lids
    tint(spot(0.0, 8.0, 4.5, 3.0) * 0.5, (1.03, 1.0, 0.92))  # forehead
    freckles = smoothstep(1.25, 1.8, value_noise(p.shape[:2], (150, 170), face.seed + 2))
    where = spot(2.2, 0.2, 3.2, 1.8) * face.freckles
    tint(freckles * where, (0.72, 0.60, 0.52))
    if face.stubble > 0:
        beard = smoothstep(-1.2, -3.0, y + 0.25 * np.clip(x - 4.5, 0, 3)) * front
        moustache = spot(0.0, -3.0, 2.2, 0.6)
        cheek = 1.0 - smoothstep(0.6, 1.4, ((x - 3.4) / 2.0) ** 2 + ((y + 2.2) / 1.9) ** 2)
        mask = np.clip(np.maximum(beard * (1 - 0.8 * cheek), moustache), 0, 1)
        dots = 0.62 + 0.38 * smoothstep(-0.6, 0.8, pores)
        tint(mask * face.stubble * dots * 0.85, (0.50, 0.50, 0.56))
    grown = _beard(p, face)
    albedo += grown[..., None] * (0.5 * np.asarray(face.hair) - albedo)
    gloss = 0.32 + 0.38 * spot(0.0, -0.3, 1.1, 2.6) + 0.20 * spot(0, 7.5, 4.0, 2.2)
    gloss += 0.12 * spot(4.2, 0.8, 1.5, 1.0)
    gloss *= (1.0 + 0.25 * pores) * (1.0 - 0.8 * grown)
    _lips(albedo, gloss, p, face)
    _brows(albedo, gloss, p, face)
    return np.clip(albedo, 0.002, 0.95), np.clip(gloss, 0.0, 1.5)


def _beard(p: np.ndarray, face: Face) -> np.ndarray:
    """How much of the skin (h, w) is hidden below beard and moustache, with a broken edge."""
    broken = 0.25 * value_noise(p.shape[:2], (150, 170), face.seed + 23)
    mask = np.zeros(p.shape[:2])
    for length, cover in ((face.beard, beard_cover), (face.moustache, moustache_cover)):
        if length > 0:
            mask = np.maximum(mask, 0.9 * smoothstep(-0.1, 0.5, cover(p, face) + broken))
    return mask


def _lips(albedo: np.ndarray, gloss: np.ndarray, p: np.ndarray, face: Face) -> None:
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    half, full = MOUTH_HALF_WIDTH * face.mouth_width, face.lip_fullness
    u = np.clip(x / half, 0.0, 1.2)
    bow = 0.60 + 0.16 * np.exp(-(((x - 0.55) / 0.45) ** 2)) - 0.02 * np.exp(-((x / 0.25) ** 2))
    upper = MOUTH_Y + full * bow * np.clip(1.0 - u**2.2, 0, 1) ** 0.75
    lower = MOUTH_Y - full * 0.95 * np.clip(1.0 - u**2.4, 0, 1) ** 0.85
    inside = np.minimum(upper - y, y - lower)
    mask = smoothstep(-0.07, 0.09, inside) * smoothstep(6.0, 7.0, z) * smoothstep(1.0, 0.93, u)
    wrinkles = value_noise(x.shape, (8, 420), face.seed + 3)
    colour = np.asarray(face.lips) * (1.0 + 0.07 * wrinkles[..., None])
    deep = 0.40 + 0.60 * smoothstep(0.02, 0.22, np.abs(y - MOUTH_Y))
    albedo += mask[..., None] * (colour * deep[..., None] - albedo)
    gloss += mask * (0.85 + 0.15 * wrinkles - gloss)


def _brows(albedo: np.ndarray, gloss: np.ndarray, p: np.ndarray, face: Face) -> None:
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    t = np.clip((x - 1.3) / 4.0, 0.0, 1.0)  # 0 at the nose, 1 at the temple
    arch = 4.42 + 0.95 * np.sin(np.pi * np.clip(t * 0.80 + 0.04, 0, 1)) - 0.35 * t**3
    thick = face.brow_thickness * (0.40 - 0.26 * t**1.5)
    across = (y - arch) / thick
    ends = smoothstep(1.05, 1.7, x) * (1.0 - smoothstep(4.7, 5.5, x))
    slant = p[..., 1] * 3.0 - x * 9.0
    strokes = 0.5 + 0.5 * np.sin(slant * 2.6 + 2.0 * value_noise(x.shape, (90, 90), face.seed + 4))
    edge = 1.0 - smoothstep(0.45, 1.25, np.abs(across) + 0.35 * strokes)
    mask = edge * ends * smoothstep(4.5, 5.5, z) * (0.62 + 0.38 * strokes) * 0.92
    hair = np.asarray(face.hair) * 0.8 + 0.004
    albedo += mask[..., None] * (hair - albedo)
    gloss *= 1.0 - 0.6 * mask
