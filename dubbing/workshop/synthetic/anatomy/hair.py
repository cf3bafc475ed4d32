"""Hair as overlapping locks: tapered strips that follow a combed direction over the skull.

Locks are rigid with the head, so they are built once. Each starts on the scalp and is carried
along the combing direction of its style at a small height above the skin.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head_shape import head_distance, outward
from dubbing.workshop.synthetic.anatomy.locks import Hair, strips, unit
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep
from dubbing.workshop.synthetic.anatomy.skin_grid import skin_grid

# The strand of loose hair over a cheek (cm): from the parting past the eye and the mouth's corner.
STRAND = np.array(
    [
        [1.4, 11.5, 5.0],
        [4.2, 8.6, 7.2],
        [5.6, 4.6, 7.0],
        [5.0, 0.4, 8.2],
        [3.6, -4.0, 8.9],
        [3.4, -8.0, 8.7],
        [3.7, -12.5, 8.2],
    ]
)
STRAND_LOCKS, STRAND_ALONG, STRAND_WIDTH = 26, 20, 0.22
ALONG = 10  # vertices along a lock


# The hairline: hair grows where z is below this function of y (cm).
_LINE_Y = (-6.0, -4.5, -3.0, -1.0, 0.5, 1.5, 3.0, 4.5, 6.0, 7.2, 8.2, 8.9, 9.3)
_LINE_Z = (-12.0, -7.5, -6.0, -4.2, -2.5, 1.2, 2.0, 2.5, 3.3, 4.6, 5.6, 6.6, 20.0)


@dataclass(frozen=True)
class Style:
    """How many locks, how long (cm), how wide, how high above the skin, and combed which way."""

    locks: int
    length: float
    width: float
    lift: float
    part_x: float = 0.0
    gravity: float = 0.3
    hangs: np.ndarray | None = None  # direction of long hair below the ears, at x > 0
    back: float = 0.0  # how much it is drawn behind the cheeks


STYLES = {
    "short": Style(1500, 2.6, 0.42, 0.45),
    "parted": Style(1150, 7.5, 0.60, 1.0, part_x=2.6),
    "swept": Style(950, 7.5, 0.60, 0.95),
    "bob": Style(
        760, 16.0, 0.85, 1.15, part_x=-1.6, gravity=0.8, hangs=np.array([0.0, -1.0, -0.06])
    ),
    "loose": Style(
        560, 27.0, 1.0, 1.0, part_x=1.2, gravity=0.8, hangs=np.array([0.02, -1.0, 0.14]), back=0.3
    ),
    "bald": Style(0, 0.0, 0.0, 0.0),
}


def hair_cover(p: np.ndarray) -> np.ndarray:
    """Signed depth (cm, positive inside) of skin points (..., 3) behind the hairline."""
    x, y, z = np.abs(p[..., 0]), p[..., 1], p[..., 2]
    temple = 0.55 * np.exp(-(((x - 5.0) / 1.4) ** 2)) * smoothstep(5.0, 8.0, y)
    return np.interp(y, _LINE_Y, _LINE_Z) - temple - z


def grow(face: Face) -> Hair:
    """The hair of a face; empty arrays for a bald one."""
    style = STYLES[face.hair_style]
    rng = np.random.default_rng(face.seed + 77)
    roots = _roots(face, style.locks, rng)
    if len(roots) == 0:
        return Hair.none()
    path, normal = _paths(face, style, roots, rng)
    hair = strips(path, normal, style.width, rng)
    if face.hair_style == "loose":
        hair = hair.with_more(strips(*_strand(face, rng), STRAND_WIDTH, rng))
    return hair


def _roots(face: Face, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points on the scalp, about evenly spread by area, (count, 3)."""
    if count == 0:
        return np.zeros((0, 3))
    p = skin_grid(face).points
    area = np.linalg.norm(np.cross(np.gradient(p, axis=0), np.gradient(p, axis=1)), axis=-1) * (
        hair_cover(p) > 0.05
    )
    chosen = rng.choice(area.size, size=count, p=(area / area.sum()).ravel())
    jitter = rng.normal(0, 0.12, (count, 3))
    return p.reshape(-1, 3)[chosen] + jitter


def _strand(face: Face, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centre lines and normals of the locks that fall over one cheek, beside the mouth."""
    t = np.linspace(0.0, 1.0, STRAND_ALONG)
    middle = PchipInterpolator(np.linspace(0.0, 1.0, len(STRAND)), STRAND)(t)
    spread = rng.normal(0, 1, (STRAND_LOCKS, 1, 3)) * np.array([0.42, 0.6, 0.25])
    lines = middle + spread * (0.35 + 0.75 * np.sin(np.pi * np.clip(t, 0, 0.6)))[:, None]
    height = rng.uniform(0.35, 0.9, (STRAND_LOCKS, 1))
    for _ in range(4):
        flat = lines.reshape(-1, 3)
        off = height - head_distance(flat, face).reshape(lines.shape[:2])
        outward = _gradient(flat, face).reshape(lines.shape)
        lines = lines + np.clip(off, 0.0, 1.0)[..., None] * outward
    return lines, _gradient(lines.reshape(-1, 3), face).reshape(lines.shape)


def _gradient(p: np.ndarray, face: Face) -> np.ndarray:
    return outward(lambda at: head_distance(at, face), p, 0.05)


def _comb(p: np.ndarray, face: Face, style: Style) -> np.ndarray:
    """Combing direction (N, 3) at points p before it is made tangent to the head."""
    x, y, z = p[:, 0], p[:, 1], p[:, 2]
    down = smoothstep(9.5, 4.0, y)[:, None]
    if face.hair_style == "short":
        top = np.stack([0.25 * x / 5.0 + 0.25, 0.0 * x, np.ones_like(x)], 1)
        side = np.stack([0.0 * x, -np.ones_like(x), -0.35 + 0.0 * x], 1)
    elif face.hair_style == "swept":
        top = np.stack([0.06 * x + 0.1, 0.3 + 0.0 * x, -np.ones_like(x)], 1)
        side = np.stack([0.0 * x, -0.45 + 0.0 * x, -np.ones_like(x)], 1)
    elif style.hangs is not None:
        away = np.tanh((x - style.part_x) / 1.0)
        top = np.stack([1.3 * away, -0.1 + 0.0 * x, 0.18 * np.sign(z) + 0.1], 1)
        side = np.stack([0.12 * np.sign(x), -np.ones_like(x), -0.12 * np.ones_like(x)], 1)
        if face.hair_style == "loose":  # behind the cheeks
            top[:, 2] = -0.12 * np.clip(z, 0.0, 5.0)
            side[:, 2] = -0.30 * np.clip(z - 0.5, 0.0, 4.0)
    else:
        away = np.tanh((x - style.part_x) / 1.2)
        top = np.stack([1.2 * away, 0.0 * x, 0.25 - 0.06 * z], 1)
        side = np.stack([0.0 * x, -np.ones_like(x), -0.55 + 0.0 * x], 1)
    return top + down * (side - top)


def _paths(
    face: Face, style: Style, roots: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Centre lines (N, ALONG, 3) and outward normals of the locks."""
    count = len(roots)
    # Hair at the sides and the neck is cut shorter, except when it hangs.
    low = smoothstep(6.5, 2.0, roots[:, 1]) if style.hangs is None else np.zeros(count)
    length = style.length * (1.0 - 0.62 * low) * rng.uniform(0.8, 1.15, count)
    depth = np.clip(hair_cover(roots), 0.0, 3.0) / 3.0
    lift = style.lift * face.hair_volume * (1.0 - 0.55 * low) * (0.55 + 0.45 * depth)
    lift = lift * rng.uniform(0.6, 1.25, count)
    wander = rng.normal(0, 0.16, (count, 3))
    # Locks begin a little before their root, so that a parting is a line and not a bare strip.
    ahead = 0.7 if face.hair_style != "bob" else 0.0  # its locks would fall over the face
    p = roots - ahead * unit(_comb(roots, face, style))
    heading = np.zeros((count, 3))
    lines, normals = [], []
    for k in range(ALONG):
        t = k / (ALONG - 1)
        n = _gradient(p, face)
        height = 0.05 + lift * np.sin(np.pi * min(0.5, 0.12 + 0.75 * t)) * (1.0 - 0.35 * t**2)
        # Below the ears long hair hangs: it is pushed out of the head, never drawn to it.
        hangs = (p[:, 1] < 1.0) & (style.hangs is not None)
        off = height - head_distance(p, face)
        off = np.where(hangs, np.maximum(off, 0.0), off)
        p = p + np.clip(off, -0.6, 0.9)[:, None] * n
        lines.append(p)
        normals.append(n)
        flow = _comb(p, face, style) + wander
        flow[:, 1] -= style.gravity * t
        if style.hangs is not None:
            mirror = np.stack([np.sign(p[:, 0]), np.ones(count), np.ones(count)], axis=1)
            hang = style.hangs * mirror + 0.5 * wander
            hang[:, 2] -= style.back * np.clip(p[:, 2], 0.0, 4.0) * (p[:, 1] > -7.0)
            hang[:, 2] -= style.back * (p[:, 2] < -2.0)  # down the back, not through the chest
            flow[hangs] = hang[hangs]
        n = np.where(hangs[:, None], 0.0, n)
        flow -= np.einsum("ij,ij->i", flow, n)[:, None] * n
        flow = unit(flow)
        heading = flow if k == 0 else 0.5 * heading + 0.5 * flow
        p = p + heading * (length / (ALONG - 1))[:, None]
    return np.stack(lines, 1), np.stack(normals, 1)
