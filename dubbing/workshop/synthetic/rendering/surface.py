"""Surface colour at ray hits: materials of skin, hair, eyes, teeth, tongue and cavity."""

from dataclasses import dataclass

import cv2
import numpy as np

from dubbing.workshop.synthetic.anatomy.eyes import look, near_eye
from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.hair import grow, hair_cover
from dubbing.workshop.synthetic.anatomy.head import (
    EAR,
    GLASSES,
    HAIR,
    LIP,
    NECK,
    SKIN,
    TEETH,
    TONGUE,
    HeadModel,
)
from dubbing.workshop.synthetic.anatomy.head_shape import MOUTH_Y, head_distance
from dubbing.workshop.synthetic.anatomy.mesh import smoothstep, value_noise
from dubbing.workshop.synthetic.anatomy.paint import TEXELS, paint
from dubbing.workshop.synthetic.rendering.shading import (
    SKIN_WRAP,
    Rig,
    catchlight,
    hair_highlights,
    highlights,
    irradiance,
)

SCATTERS = (SKIN, LIP, EAR, NECK)
CAVITY = np.array([0.045, 0.013, 0.012])
ENAMEL = np.array([0.66, 0.60, 0.50])
GUMS = np.array([0.42, 0.13, 0.12])
PLASTIC = np.array([0.016, 0.014, 0.015])
FLESH = np.array([0.34, 0.085, 0.08])
EYEBALL, DARK = 1, 3  # labels beside those of the parts
LASHES = np.array([0.012, 0.009, 0.008])
EYE_WRAP = np.array([0.42, 0.36, 0.34])  # light spreads inside the eyeball


@dataclass(frozen=True)
class Hits:
    """Rays that met the head: their index, triangle, barycentric u, v, length (cm), direction."""

    index: np.ndarray
    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    length: np.ndarray
    ray: np.ndarray

    def only(self, keep: np.ndarray) -> "Hits":
        return Hits(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Geometry:
    """The vertices of one frame: triangles (M, 3), corners and normals (V, 3), head frame, cm."""

    triangles: np.ndarray
    corners: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class View:
    """Viewpoint, eyes and light, in the head frame: camera centre (3,), gaze (2, 3), blink, lights.

    `inside` (0..1) is the light that the lips let into the mouth.
    """

    eye: np.ndarray
    gaze: np.ndarray
    blink: float
    inside: float
    rig: Rig


@dataclass
class Layers:
    """Shading inputs of N points; the materials fill them in one after the other."""

    point: np.ndarray
    normal: np.ndarray
    part: np.ndarray
    albedo: np.ndarray
    gloss: np.ndarray
    power: np.ndarray
    occlusion: np.ndarray
    wrap: np.ndarray
    solid: np.ndarray
    label: np.ndarray

    @staticmethod
    def blank(point: np.ndarray, normal: np.ndarray, part: np.ndarray) -> "Layers":
        n = len(point)
        return Layers(
            point,
            normal,
            part,
            albedo=np.zeros((n, 3), np.float32),
            gloss=np.full(n, 0.3, np.float32),
            power=np.full(n, 22.0, np.float32),
            occlusion=np.ones(n, np.float32),
            wrap=np.tile(SKIN_WRAP.astype(np.float32), (n, 1)),
            solid=np.zeros(n, bool),
            label=part * 4,  # leaves room for the labels below
        )


@dataclass(frozen=True)
class Shaded:
    """albedo, light and shine (N, 3): colour = albedo * light + shine. part and label (N,).

    `solid` marks surfaces without subsurface scattering (eyes, lashes, the inside of the mouth).
    `label` separates materials when edges are detected.
    """

    albedo: np.ndarray
    light: np.ndarray
    shine: np.ndarray
    part: np.ndarray
    label: np.ndarray
    solid: np.ndarray


class Materials:
    """Textures and vertex colours of one face."""

    def __init__(self, face: Face, model: HeadModel) -> None:
        self.face = face
        self.texture = paint(face)
        self.hair = grow(face)
        none = np.zeros((len(self.hair.vertices), 2), np.float32)
        self.part = np.concatenate([model.part, np.full(len(none), HAIR, np.int8)])
        self.uv = np.concatenate([model.uv, none])
        self.rest = model.rest
        beard = model.beard.hair
        bare = len(model.rest) - len(beard.vertices)
        strand = np.concatenate([np.zeros((bare, 2)), beard.strand, self.hair.strand])
        tangent = np.concatenate([np.zeros((bare, 3)), beard.tangents, self.hair.tangents])
        shade = np.concatenate([model.lip_shade()[:bare], beard.shade, self.hair.shade])
        self.strand, self.tangent = strand.astype(np.float32), tangent.astype(np.float32)
        self.shade_of = shade.astype(np.float32)
        self.streaks = value_noise((64, 4096), (6, 900), face.seed + 21)
        self._tint_scalp(model)

    def _tint_scalp(self, model: HeadModel) -> None:
        """Skin below the hair takes the hair's colour, with a broken edge."""
        if self.face.hair_style == "bald":
            return
        h, w = self.texture.gloss.shape
        cover = hair_cover(model.grid.points).astype(np.float32)
        cover = np.concatenate([cover, cover[:, :1]], axis=1)
        grown = cv2.resize(cover, (w, h), interpolation=cv2.INTER_LINEAR)
        grown = grown + 0.16 * value_noise((h, w), (150, 170), self.face.seed + 22)
        mask = 0.9 * smoothstep(-0.05, 1.1, grown)[..., None]
        colour = np.asarray(self.face.hair) * 0.45
        self.texture.albedo[...] += (mask * (colour - self.texture.albedo)).astype(np.float32)
        self.texture.gloss[...] *= 1.0 - 0.75 * mask[..., 0]

    def shade(self, hits: Hits, geometry: Geometry, shadow: np.ndarray, view: View) -> Shaded:
        """Shaded surface at the hits of the rays; shadow (N,) is 1 where the key light arrives."""
        tri = geometry.triangles[hits.triangle]
        weights = np.stack([1.0 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float32)

        def mix(values: np.ndarray, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
            return np.einsum("nk,nkc->nc", weights[rows], values[tri[rows]], dtype=np.float32)

        n = mix(geometry.normals)
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-9)
        p = (view.eye + hits.ray * hits.length[:, None]).astype(np.float32)
        layers = Layers.blank(p, n, self.part[tri[:, 0]].astype(np.int64))
        textured = np.flatnonzero((layers.part == SKIN) | (layers.part == LIP))
        uv = mix(self.uv, textured).astype(np.float32) * TEXELS
        layers.albedo[textured] = self._lookup(self.texture.albedo, uv)
        layers.gloss[textured] = self._lookup(self.texture.gloss, uv)
        layers.occlusion[textured] = self._lookup(self.texture.occlusion, uv)
        self._plain_parts(layers)
        away = np.isin(layers.part, (SKIN, LIP, NECK)) & _through_mouth(p, hits.ray)
        within = layers.part == NECK
        neck = np.flatnonzero(away & within)  # beside the chin a ray reaches it from outside
        away[neck] = head_distance(p[neck], self.face) < 0.0
        away[away] = within[away] | _back_faces(geometry.corners[tri[away]], hits.ray[away])
        n[away & ~within] *= -1.0
        # Smoothed normals at a silhouette may face away: they are bent until they just do not.
        n -= np.clip(np.einsum("ij,ij->i", n, hits.ray), 0.0, None)[:, None] * hits.ray
        self._mouth(layers, away, view.inside)
        lips = np.flatnonzero(layers.part == LIP)
        layers.occlusion[lips] *= mix(self.shade_of[:, None], lips)[:, 0]
        self._eyes(layers, hits.ray, view)
        strands = np.flatnonzero(layers.part == HAIR)
        colour = self._hair_colour(mix(self.strand, strands), mix(self.shade_of[:, None], strands))
        layers.albedo[strands], layers.gloss[strands] = colour, 0.0
        layers.wrap[strands], layers.occlusion[strands] = 0.25, 0.85
        layers.solid[strands] = True
        light = irradiance(n, layers.occlusion, shadow, view.rig, layers.wrap)
        shine = highlights(
            n,
            hits.ray,
            strength=layers.gloss * layers.occlusion,
            power=layers.power,
            shadow=shadow,
            rig=view.rig,
        )
        wet = np.flatnonzero(layers.label == EYEBALL)
        shine[wet] += catchlight(n[wet], hits.ray[wet], view.rig)
        tangent = mix(self.tangent, strands)
        shine[strands] = hair_highlights(
            tangent, hits.ray[strands], colour, shadow[strands], view.rig
        )
        return Shaded(layers.albedo, light, shine, layers.part, layers.label, layers.solid)

    @staticmethod
    def _lookup(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
        """Bilinear values at texel positions uv (N, 2)."""
        pad = 1024 - len(uv) % 1024  # remap takes no image longer than 32767 in each direction
        grid = np.concatenate([uv, np.zeros((pad, 2), np.float32)]).reshape(-1, 1024, 2)
        edge = cv2.BORDER_REPLICATE
        out = cv2.remap(texture, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=edge)
        return out.reshape(-1, *texture.shape[2:])[: len(uv)]

    def _plain_parts(self, layers: Layers) -> None:
        """Ears, neck and glasses, which have no texture."""
        plastic = layers.part == GLASSES
        layers.albedo[plastic], layers.gloss[plastic], layers.power[plastic] = PLASTIC, 1.4, 90.0
        layers.wrap[plastic], layers.solid[plastic] = 0.0, True
        skin, p = np.asarray(self.face.skin), layers.point
        ear = layers.part == EAR
        layers.albedo[ear] = skin * np.array([1.02, 0.82, 0.82])
        layers.occlusion[ear] = 0.75
        neck = layers.part == NECK
        layers.albedo[neck] = skin * 0.97
        chin = smoothstep(-13.5, -7.5, p[neck, 1]) * smoothstep(9.0, 2.0, np.abs(p[neck, 0]))
        layers.occlusion[neck] = 1.0 - 0.62 * chin
        layers.gloss[neck] = 0.2

    @staticmethod
    def _mouth(layers: Layers, behind: np.ndarray, light: float) -> None:
        """Teeth, gums, tongue, and the dark behind them: back faces of the skin."""
        p, part = layers.point, layers.part
        teeth = np.flatnonzero(part == TEETH)
        height = np.abs(p[teeth, 1] - MOUTH_Y)
        layers.albedo[teeth] = ENAMEL
        gum = smoothstep(0.62, 0.78, height) * (p[teeth, 1] > MOUTH_Y - 0.35)
        layers.albedo[teeth] += gum[:, None] * (GUMS - layers.albedo[teeth])
        layers.gloss[teeth], layers.power[teeth] = 0.8, 60.0
        tongue = part == TONGUE
        layers.albedo[tongue], layers.gloss[tongue], layers.power[tongue] = FLESH, 0.35, 30.0
        cavity = np.flatnonzero(behind)
        layers.albedo[cavity], layers.gloss[cavity], layers.solid[cavity] = CAVITY, 0.0, True
        layers.occlusion[cavity] = 0.10 + 0.5 * smoothstep(3.0, 8.8, p[cavity, 2])
        layers.label[cavity] = DARK
        inner = (part == TEETH) | tongue
        layers.occlusion[inner] *= light * (0.16 + 0.84 * smoothstep(6.8, 9.3, p[inner, 2]))
        # The key light knows no occlusion, so the colour is darkened as well.
        layers.albedo[inner] *= light
        layers.solid |= (part == TEETH) | tongue

    def _eyes(self, layers: Layers, ray: np.ndarray, view: View) -> None:
        near = np.flatnonzero((layers.part == SKIN) & near_eye(layers.point))
        eyes = look(
            layers.point[near],
            view.eye,
            ray[near],
            gaze=view.gaze,
            blink=view.blink,
            face=self.face,
        )
        lash = np.clip(eyes.lash, 0, 1)[:, None]
        layers.albedo[near] *= 1.0 - 0.42 * eyes.crease[:, None] * (1 - 0.6 * view.blink)
        layers.albedo[near] += lash * (LASHES - layers.albedo[near])
        layers.gloss[near] *= 1.0 - 0.9 * lash[:, 0]
        layers.solid[near] |= eyes.lash > 0.35
        ball = near[eyes.open]
        layers.albedo[ball], layers.normal[ball] = eyes.albedo[eyes.open], eyes.normal[eyes.open]
        layers.occlusion[ball] = eyes.occlusion[eyes.open]
        layers.albedo[ball] *= eyes.occlusion[eyes.open][:, None]
        layers.gloss[ball], layers.power[ball] = 1.0, 320.0
        layers.wrap[ball] = EYE_WRAP
        layers.solid[ball] = True
        layers.label[ball] = EYEBALL

    def _hair_colour(self, strand: np.ndarray, shade: np.ndarray) -> np.ndarray:
        across = (strand[:, 0] * 80.0) % 4095.0
        along = np.clip(strand[:, 1], 0, 1) * 63.0
        streak = self.streaks[along.astype(int), across.astype(int)]
        tone = np.clip(1.0 + 0.30 * streak, 0.35, 2.0) * shade[:, 0]
        return np.asarray(self.face.hair) * tone[:, None]


def _back_faces(corners: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """(N,) bool: rays (N, 3) that met triangles with corners (N, 3, 3) from behind."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.einsum("ij,ij->i", n, ray) > 0.0


def _through_mouth(p: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """(N,) bool: rays that reached p (N, 3) from outside through the place of the lips.

    Only there back faces are the inside of the cheeks; at silhouettes they would be dark specks.
    """
    at_lips = p - ray * ((p[:, 2] - 9.0) / np.minimum(ray[:, 2], -1e-3))[:, None]
    beside, above = np.abs(at_lips[:, 0]), at_lips[:, 1] - MOUTH_Y
    return ((beside / 3.2) ** 2 + ((above + 1.1) / 2.5) ** 2 < 1.0) & (p[:, 2] < 9.3)
