"""The head as one array of vertices: skin, inner lips, teeth, tongue, ears, neck, beard
and glasses.

Vertices are centimetres in the head frame (see `head_shape`). `HeadModel.vertices` gives them for
one mouth shape; the renderer casts rays at `static` triangles (never move) and `moving` ones.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dubbing.workshop.synthetic.anatomy.beard import grow_beard
from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.glasses import frames
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_HALF_WIDTH, MOUTH_Y
from dubbing.workshop.synthetic.anatomy.lips import LipWeights, MouthShape, turn_jaw
from dubbing.workshop.synthetic.anatomy.mesh import Patch, smoothstep
from dubbing.workshop.synthetic.anatomy.skin_grid import skin_grid

SKIN, LIP, TEETH, GUM, TONGUE, EAR, NECK, HAIR, GLASSES = range(9)
INNER_ROWS = 6
NECK_TOP, NECK_BOTTOM = -3.5, -15.5  # heights of the neck's ends, cm
NECK_JOINT = np.array([0.0, -8.5, -3.5])
NAPE = 4.0  # cm that the neck reaches up into the back of the head
NAPE_ROWS, NAPE_COLUMNS = 9, 45
FAR_DEGREES = (25.0, 40.0)  # between a head turned a little and one turned far


@dataclass(frozen=True)
class Trunk:
    """Where the body is, seen from the head: x_head = rotation x_body + shift (cm)."""

    rotation: np.ndarray
    shift: np.ndarray

    @property
    def far(self) -> float:
        """0 for a head that is turned a little, 1 for one that is turned far."""
        turn = Rotation.from_matrix(self.rotation).magnitude()
        return float(smoothstep(*FAR_DEGREES, np.degrees(turn)))


class HeadModel:
    """Rest vertices, patches and triangles of one face."""

    def __init__(self, face: Face) -> None:
        self.face = face
        grid = skin_grid(face)
        self.grid = grid
        rows, columns = grid.points.shape[:2]
        row = grid.mouth_row
        self._parts: list[np.ndarray] = []
        self.patches: dict[str, Patch] = {}
        self._count = 0
        self._add("upper", grid.points[: row + 1], SKIN, wrap=True)
        self._add("lower", grid.points[row:], SKIN, wrap=True)
        line = grid.points[row]
        inside = np.flatnonzero(
            (np.abs(line[:, 0]) < MOUTH_HALF_WIDTH * face.mouth_width) & (line[:, 2] > 4)
        )
        self.mouth_columns = np.arange(inside[0] - 1, inside[-1] + 2)
        self.middle = int(np.argmin(np.abs(line[:, 0]) + (line[:, 2] < 0) * 99))
        self._add("inner_upper", _inner(line[self.mouth_columns], 1.0), LIP)
        self._add("inner_lower", _inner(line[self.mouth_columns], -1.0)[::-1], LIP)
        self._add("teeth_upper", _teeth(upper=True), TEETH)
        self._add("teeth_lower", _teeth(upper=False), TEETH)
        self._add("tongue", _tongue(), TONGUE, wrap=True)
        self._add("neck", _neck(), NECK, wrap=True)
        self._add("nape", _nape(), NECK)
        for side in (-1.0, 1.0):
            self._add(f"ear{side:+.0f}", _ear(side), EAR, wrap=True, flip=side < 0)
        rigid = ["teeth_upper", "ear-1", "ear+1"]
        if face.glasses:
            for name, tube in frames(face).items():
                self._add(name, tube, GLASSES, wrap=True)
                rigid.append(name)
        self.rest = np.concatenate(self._parts)
        self._bare = self._count
        self.beard = grow_beard(face, grid)
        self.rest = np.concatenate([self.rest, self.beard.hair.vertices])
        self._corner = np.clip(np.abs(line[:, 0]) / (MOUTH_HALF_WIDTH * face.mouth_width), 0, 1)
        self._corner = np.where(line[:, 2] > 0, self._corner, 1.0) ** 4
        lower = np.zeros(len(self.rest), bool)
        for name in ("lower", "inner_lower"):
            lower[self._range(name)] = True
        self._lip_range = slice(0, self.patches["inner_lower"].last)
        self.weights = LipWeights(self.rest[self._lip_range], lower[self._lip_range], face)
        for name, at in (("inner_upper", "upper"), ("inner_lower", "lower")):
            self._copy_line_weights(name, at)
        self._split_triangles(rigid)
        self.uv = self._texture_coordinates(rows, columns)

    def _add(
        self, name: str, grid: np.ndarray, part: int, *, wrap: bool = False, flip: bool = False
    ) -> None:
        rows, columns = grid.shape[:2]
        self.patches[name] = Patch(self._count, rows, columns, part, wrap, flip)
        self._parts.append(grid.reshape(-1, 3))
        self._count += rows * columns

    def _range(self, name: str) -> slice:
        return slice(self.patches[name].first, self.patches[name].last)

    def line_indices(self, lip: str) -> np.ndarray:
        """Vertices of the mouth line of the "upper" or the "lower" lip, all columns."""
        patch = self.patches[lip]
        last = patch.last - patch.columns if lip == "upper" else patch.first
        return np.arange(last, last + patch.columns)

    def _copy_line_weights(self, inner: str, lip: str) -> None:
        """Rows that curl into the mouth follow the vertex of the mouth line they come from."""
        source = np.tile(self.line_indices(lip)[self.mouth_columns], INNER_ROWS)
        target = np.arange(self.patches[inner].first, self.patches[inner].last)
        for name in ("jaw", "part", "wide", "protrude", "press", "roll", "tuck", "smile", "back"):
            weights = getattr(self.weights, name)
            weights[target] = weights[source]

    def _split_triangles(self, rigid: list[str]) -> None:
        triangles = np.concatenate([p.triangles() for p in self.patches.values()])
        moving = np.ones(len(self.rest), bool)
        moving[self._lip_range] = self.weights.moved
        for name in rigid:
            moving[self._range(name)] = False
        moves = moving[triangles].any(axis=1)
        hair = self.beard.hair.triangles + self._bare
        self.static, self.moving = triangles[~moves], np.concatenate([triangles[moves], hair])
        part = np.full(len(self.rest), HAIR, np.int8)
        for name, patch in self.patches.items():
            part[self._range(name)] = patch.part
        self.part = part

    def _texture_coordinates(self, rows: int, columns: int) -> np.ndarray:
        """(V, 2) column and row of the skin grid for skin and lips, -1 elsewhere."""
        uv = np.full((len(self.rest), 2), -1.0, np.float32)
        row, col = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
        both = np.stack([col, row], axis=-1).astype(np.float32)
        line = self.grid.mouth_row
        uv[self._range("upper")] = both[: line + 1].reshape(-1, 2)
        uv[self._range("lower")] = both[line:].reshape(-1, 2)
        for name in ("inner_upper", "inner_lower"):
            uv[self._range(name)] = np.tile(both[line, self.mouth_columns], (INNER_ROWS, 1))
        return uv

    def vertices(self, shape: MouthShape, trunk: Trunk) -> np.ndarray:
        """(V, 3) vertices of one frame."""
        out = self.rest.copy()
        out[self._lip_range] = self.weights.apply(self.rest[self._lip_range], shape)
        lower = self._range("teeth_lower")
        out[lower] = turn_jaw(out[lower], shape.jaw)
        tongue = self._range("tongue")
        out[tongue] = _raise_tongue(out[tongue], shape)
        neck = self._range("neck")
        rest = out[neck]
        low = smoothstep(NECK_TOP - 3.0, NECK_BOTTOM + 1.5, rest[:, 1])[:, None]
        far = trunk.far
        out[neck] = _bend_neck(rest, low, trunk, far)
        nape, ring = self._range("nape"), self.rest[self._range("nape")][-NAPE_COLUMNS:]
        ring = np.tile(ring, (NAPE_ROWS, 1))
        out[nape] = ring + far * (out[nape] - ring)
        roots = self.beard.roots
        out[self._bare :] += out[roots] - self.rest[roots]
        return out

    def normals(self, vertices: np.ndarray) -> np.ndarray:
        """(V, 3) unit normals; across the mouth line they join outside the mouth only."""
        patches = [p.normals(vertices) for p in self.patches.values()]
        n = np.concatenate([*patches, self.beard.hair.normals])
        up, low = self.line_indices("upper"), self.line_indices("lower")
        joined = n[up] + n[low]
        joined /= np.maximum(np.linalg.norm(joined, axis=1, keepdims=True), 1e-9)
        keep = self._corner[:, None]
        n[up] += keep * (joined - n[up])
        n[low] += keep * (joined - n[low])
        return n

    def lip_shade(self) -> np.ndarray:
        """(V,) light that reaches the rows inside the lips: 1 outside, less with depth."""
        shade = np.ones(len(self.rest))
        fall = np.linspace(1.0, 0.12, INNER_ROWS)
        across = len(self.mouth_columns)
        shade[self._range("inner_upper")] = np.repeat(fall, across)
        shade[self._range("inner_lower")] = np.repeat(fall[::-1], across)
        return shade

    def mouth_box(self) -> np.ndarray:
        """Points (4, 3) beside and above the mouth at rest whose extent holds an open one."""
        line = self.rest[self.line_indices("upper")[self.mouth_columns]]
        wide = 1.25 * np.abs(line[:, 0]).max()
        front = line[:, 2].max()
        side = [[x, MOUTH_Y, front - 1.5] for x in (-wide, wide)]
        return np.array([*side, [0, MOUTH_Y + 1.6, front], [0, MOUTH_Y - 3.2, front]])

    def opening(self, vertices: np.ndarray) -> float:
        """Height of the gap between the lips in the middle, in units of 10 cm."""
        up = vertices[self.line_indices("upper")[self.middle]]
        low = vertices[self.line_indices("lower")[self.middle]]
        return float(up[1] - low[1]) / 10.0


def _inner(line: np.ndarray, side: float) -> np.ndarray:
    """Rows (INNER_ROWS, M, 3) from the mouth line straight back; side +1 is the upper lip."""
    depth = np.linspace(0.0, 1.0, INNER_ROWS)[:, None]
    out = np.repeat(line[None], INNER_ROWS, axis=0)
    out[..., 2] -= 0.95 * depth
    out[..., 0] *= 1.0 - 0.12 * depth
    out[..., 1] += side * 0.10 * depth**2
    return out


def _teeth(upper: bool) -> np.ndarray:
    """An arch of teeth (9, 97, 3): rows from the gum to the edge for the upper, reversed below."""
    t = np.linspace(-1.0, 1.0, 97)
    half, front = (2.55, 8.60) if upper else (2.35, 8.25)
    x, z = half * np.sin(t * 1.45), front - 3.6 * (1 - np.cos(t * 1.35))
    tooth = np.abs(np.sin(np.pi * (t * 6.0)))  # 12 teeth, gaps where it is 0
    v = np.linspace(0.0, 1.0, 9)[:, None]
    height = 1.10 if upper else 0.95
    incisor = 0.10 * np.exp(-((t / 0.2) ** 2)) if upper else 0.0 * t
    edge = -(height + incisor) + 0.09 * (1 - tooth**0.5)
    y = (MOUTH_Y + 0.92) + v * edge if upper else (MOUTH_Y - 1.25) - v * edge
    bulge = 0.16 * np.sin(np.pi * np.clip(v * 0.8 + 0.1, 0, 1)) + 0.10 * tooth**0.5 - 0.22 * v**3
    grid = np.stack([np.broadcast_to(x, y.shape), y, z + bulge * np.cos(t * 1.2)], axis=-1)
    return grid if upper else grid[::-1]


def _tongue() -> np.ndarray:
    a = np.linspace(-np.pi, np.pi, 25)[:-1]
    e = np.linspace(np.pi / 2, -np.pi / 2, 13)[:, None]
    x, y, z = np.cos(e) * np.sin(a), np.sin(e) * np.ones_like(a), np.cos(e) * np.cos(a)
    y = y - 0.25 * np.exp(-((x / 0.2) ** 2)) * (y > 0)
    return np.stack([1.75 * x, -5.75 + 0.55 * y, 5.2 + 2.3 * z], axis=-1)


def _raise_tongue(points: np.ndarray, shape: MouthShape) -> np.ndarray:
    out = turn_jaw(points, 0.9 * shape.jaw)
    tip = smoothstep(4.6, 7.4, points[:, 2])
    out[:, 1] += shape.tongue * (0.10 + 0.75 * tip)
    return out


def _neck() -> np.ndarray:
    a = np.linspace(-np.pi, np.pi, 73)[:-1]
    # In front the neck begins below the floor of the mouth, which would show it otherwise.
    top = NECK_TOP - 4.3 * smoothstep(0.5, 0.85, np.cos(a))
    y = top + np.linspace(0.0, 1.0, 26)[:, None] * (NECK_BOTTOM - top)
    return _rings(a, y)


def _nape() -> np.ndarray:
    """Back and sides of the neck above its top, up into the hair: seen when the head is turned."""
    a = np.linspace(1.1, 2 * np.pi - 1.1, NAPE_COLUMNS)
    rise = NAPE * smoothstep(-0.2, 0.2, -np.cos(a))
    return _rings(a, NECK_TOP + np.linspace(1.0, 0.0, NAPE_ROWS)[:, None] * rise)


def _rings(a: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Points (rows, columns, 3) of the neck at azimuths a and heights y (rows, columns)."""
    t = (NECK_TOP - y) / (NECK_TOP - NECK_BOTTOM)
    x = (4.75 + 0.9 * t**2 + 3.0 * np.clip(t - 0.72, 0, 1) ** 1.5 * 4) * np.sin(a)
    front = np.clip(np.cos(a), 0, 1)
    radius = 4.9 + 0.8 * t
    cord = 0.35 * np.exp(-(((np.abs(a) - 0.62 + 0.35 * t) / 0.16) ** 2)) * np.clip(t - 0.1, 0, 1)
    apple = 0.45 * np.exp(-((a / 0.22) ** 2)) * np.exp(-(((y + 9.2) / 1.0) ** 2))
    z = -2.2 - 0.6 * t + (radius + cord + apple) * np.cos(a) - 0.4 * front * t
    return np.stack([x + cord * np.sin(a), np.broadcast_to(y, x.shape), z], axis=-1)


def _bend_neck(rest: np.ndarray, low: np.ndarray, trunk: Trunk, far: float) -> np.ndarray:
    """Neck points (V, 3) between head and body; low (V, 1) is how much they follow the body."""
    straight = rest + low * (rest @ trunk.rotation.T + trunk.shift - rest)
    if far == 0.0:
        return straight
    # A straight blend of two far turned ends would draw the neck together between them.
    turn = Rotation.from_matrix(trunk.rotation).as_rotvec()
    shift = trunk.rotation @ NECK_JOINT + trunk.shift - NECK_JOINT
    twisted = Rotation.from_rotvec(low * turn).apply(rest - NECK_JOINT) + NECK_JOINT + low * shift
    return straight + far * (twisted - straight)


def _ear(side: float) -> np.ndarray:
    """A shell (14, 40, 3): rows from the rim's back over the rim to the middle."""
    a = np.linspace(0.0, 2 * np.pi, 41)[:-1]
    r = np.array([0.55, 0.85, 1.0, 1.05, 1.02, 0.95, 0.88, 0.8, 0.7, 0.6, 0.5, 0.38, 0.22, 0.0])
    out = np.array([-0.4, 0.1, 0.5, 0.85, 1.0, 0.98, 0.78, 0.62, 0.68, 0.72, 0.5, 0.15, -0.1, -0.2])
    up, back = np.cos(a), np.sin(a)
    lobe = np.clip(-up, 0, 1) ** 2
    height = 3.0 * r[:, None] * up * (1 + 0.12 * lobe)
    width = r[:, None] * back * (1.75 - 0.65 * lobe + 0.25 * np.clip(up, 0, 1))
    rim = out[:, None] * (1.0 - 0.35 * lobe)
    tilt = 0.45  # the shell stands out at the back
    x = 6.75 + rim * np.cos(tilt) + np.clip(width, -2, 2) * np.sin(tilt)
    z = -1.0 - width * np.cos(tilt) + rim * np.sin(tilt)
    y = 0.5 + height - 0.12 * width
    return np.stack([side * x, y, z], axis=-1)
