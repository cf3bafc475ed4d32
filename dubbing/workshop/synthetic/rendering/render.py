"""One image of the speaker: rays at the head, deferred shading, composition before the plate.

Embree finds what each pixel sees (two scenes: what never moves in the head frame, and what does).
Skin light is blurred per colour under the skin, the key light's shadow is found on a third of the
pixels, and pixels on an edge are sampled again at four places.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from scipy.spatial import ConvexHull

from dubbing.workshop.synthetic.anatomy.eyes import within_reach
from dubbing.workshop.synthetic.anatomy.face import Face
from dubbing.workshop.synthetic.anatomy.head import NECK, HeadModel, Trunk
from dubbing.workshop.synthetic.anatomy.head_shape import EYE
from dubbing.workshop.synthetic.anatomy.lips import MouthShape
from dubbing.workshop.synthetic.rendering.camera import DISTANCE, Camera, Pose
from dubbing.workshop.synthetic.rendering.room import room
from dubbing.workshop.synthetic.rendering.shading import Lighting, Rig, develop
from dubbing.workshop.synthetic.rendering.surface import (
    SCATTERS,
    Geometry,
    Hits,
    Materials,
    Shaded,
    View,
)
from dubbing.workshop.synthetic.rendering.torso import shoot

SUBSAMPLES = ((-0.125, -0.375), (0.375, -0.125), (0.125, 0.375), (-0.375, 0.125))
SHADOW_STEP = 3
SHADOW_RAYS = 4
OPEN_GAP = 0.09  # units of 10 cm between the lips that let all light in
DEPTH_STEP = 0.7  # cm between neighbouring pixels that count as an edge
SCATTER_CM = (0.24, 0.12, 0.07)  # blur of red, green and blue light under the skin
REST_SHIFT = np.array([0.0, 0.6, -DISTANCE])  # where the body stands, camera axes, cm


@dataclass(frozen=True)
class State:
    """Everything that changes from frame to frame. gaze: degrees right and up from the camera."""

    pose: Pose
    mouth: MouthShape = field(default=MouthShape())
    blink: float = 0.0
    gaze: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class RenderedFrame:
    """image (S, S, 3) uint8; head and person mattes (S, S) uint8; mouth opening in 10 cm.

    The head matte holds face, ears and hair without the neck; the person matte all of the body.
    """

    image: np.ndarray
    head: np.ndarray
    person: np.ndarray
    opening: float


class Renderer:
    """Renders one face at one size. Building it takes seconds, a frame a fraction of one."""

    def __init__(self, face: Face, size: int, zoom: float = 1.0, light: Lighting = "soft") -> None:
        self.camera = Camera(size, zoom)
        self.light: Lighting = light
        self.model = HeadModel(face)
        self.materials = Materials(face, self.model)
        self.plate = shoot(self.camera, REST_SHIFT, face, room(size, face), light)
        rest = self.model.vertices(MouthShape(), Trunk(np.eye(3), np.zeros(3)))
        corners = np.concatenate([rest, self.materials.hair.vertices]).astype(np.float32)
        hair = self.materials.hair.triangles + len(rest)
        still = np.concatenate([self.model.static, hair]).astype(np.int32)
        self.still = EmbreeScene()
        TriangleMesh(self.still, corners, still)
        self.triangles = np.concatenate([still, self.model.moving])
        self.moving_first = len(still)
        self.hull = corners[ConvexHull(corners).vertices].astype(np.float64)
        self.outline = np.unique(self.model.moving)[::2]

    def render(self, state: State) -> RenderedFrame:
        """One frame, with its mattes."""
        pose = state.pose
        to_head = pose.turn.T
        trunk = Trunk(to_head, to_head @ (REST_SHIFT - pose.shift))
        vertices = self.model.vertices(state.mouth, trunk)
        frame = _Frame(self, state, vertices, Rig.turned(to_head, self.light))
        box = frame.box()
        colour, head, neck = frame.draw(box)
        top, left, bottom, right = box
        image = self.plate.colour.copy()
        image[top:bottom, left:right] = colour
        matte = np.zeros(image.shape[:2])
        matte[top:bottom, left:right] = head
        person = self.plate.body.copy()
        inside = person[top:bottom, left:right]
        np.maximum(inside, head + neck, out=inside)
        return RenderedFrame(
            np.clip(np.rint(image), 0, 255).astype(np.uint8),
            np.rint(255 * matte).astype(np.uint8),
            np.rint(255 * np.clip(person, 0, 1)).astype(np.uint8),
            self.model.opening(vertices),
        )

    def project(self, pose: Pose, points: np.ndarray) -> np.ndarray:
        """Pixels (N, 2) of points (N, 3) given in the head frame used inside, cm."""
        return self.camera.project(points @ pose.turn.T + pose.shift)

    def light_inside(self, state: State, vertices: np.ndarray) -> float:
        """Light in the mouth, 0..1: little behind lips that are nearly closed or rounded."""
        gap = float(np.clip(self.model.opening(vertices) / OPEN_GAP, 0.0, 1.0))
        return (0.65 + 0.35 * gap) * (1.0 - 0.25 * max(0.0, -state.mouth.wide))

    def gaze(self, state: State) -> np.ndarray:
        """(2, 3) unit view directions of the eyes at -x and +x in the head frame."""
        right, up = np.radians(state.gaze)
        centres = np.array([[-EYE[0], EYE[1], EYE[2]], EYE])
        d = state.pose.eye - centres
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        d += np.array([np.tan(right), np.tan(up), 0.0])
        return within_reach(d / np.linalg.norm(d, axis=1, keepdims=True))


class _Frame:
    """The work of one frame: scene, rays, shading."""

    def __init__(self, owner: Renderer, state: State, vertices: np.ndarray, rig: Rig) -> None:
        self.owner, self.rig = owner, rig
        self.pose, self.camera = state.pose, owner.camera
        hair = owner.materials.hair
        self.geometry = Geometry(
            owner.triangles,
            np.concatenate([vertices, hair.vertices]).astype(np.float32),
            np.concatenate([owner.model.normals(vertices), hair.normals]).astype(np.float32),
        )
        self.view = View(
            state.pose.eye, owner.gaze(state), state.blink, owner.light_inside(state, vertices), rig
        )
        self.scene = EmbreeScene()
        TriangleMesh(self.scene, vertices.astype(np.float32), owner.model.moving)

    def box(self) -> tuple[int, int, int, int]:
        """Top, left, bottom, right of the pixels that may see the head."""
        extent = np.concatenate([self.owner.hull, self.geometry.corners[self.owner.outline]])
        p = self.owner.project(self.pose, extent)
        low, high = np.floor(p.min(axis=0)) - 3, np.ceil(p.max(axis=0)) + 4
        left, top = np.clip(low, 0, self.camera.size).astype(int)
        right, bottom = np.clip(high, 0, self.camera.size).astype(int)
        return int(top), int(left), int(bottom), int(right)

    def cast(self, directions: np.ndarray) -> Hits:
        """First hits of rays (N, 3) in the head frame from the camera."""
        rays = np.ascontiguousarray(directions, np.float32)
        start = np.broadcast_to(self.pose.eye.astype(np.float32), rays.shape).copy()
        still = self.owner.still.run(start, rays, output=1)
        moving = self.scene.run(start, rays, output=1)
        far_still = np.where(still["geomID"] >= 0, still["tfar"], np.inf)
        far_moving = np.where(moving["geomID"] >= 0, moving["tfar"], np.inf)
        first = far_moving < far_still
        length = np.minimum(far_still, far_moving)
        hit = np.flatnonzero(np.isfinite(length))
        pick = first[hit]
        triangle = np.where(
            pick, moving["primID"][hit] + self.owner.moving_first, still["primID"][hit]
        )
        u = np.where(pick, moving["u"][hit], still["u"][hit])
        v = np.where(pick, moving["v"][hit], still["v"][hit])
        return Hits(hit, triangle, u, v, length[hit], rays[hit])

    def draw(self, box: tuple[int, int, int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Colour 0..255 (h, w, 3), head cover (h, w) and neck cover (h, w) of the box."""
        top, left, bottom, right = box
        h, w = bottom - top, right - left
        col, row = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
        turn = self.pose.turn  # camera = turn @ head, so head = camera @ turn
        rays = self.camera.rays(col.ravel(), row.ravel()) @ turn
        depth = self.owner.plate.depth[top:bottom, left:right].ravel()
        hits = self.before(self.cast(rays), depth)
        shadow = self.shadow(hits, (h, w))
        shaded = self.shade(hits, shadow.ravel()[hits.index])
        light = self.scatter(shaded, hits, (h, w))
        plate = self.owner.plate.colour[top:bottom, left:right].reshape(-1, 3)
        colour = plate.copy()
        colour[hits.index] = develop(shaded.albedo * light + shaded.shine)
        label = np.full(h * w, -1)
        label[hits.index] = shaded.label
        depth = np.full(h * w, 1e4)
        depth[hits.index] = hits.length
        first = hits
        edge = _edges(label.reshape(h, w), depth.reshape(h, w))
        head = np.zeros(h * w)
        neck = np.zeros(h * w)
        head[hits.index] = shaded.part != NECK
        neck[hits.index] = shaded.part == NECK
        at = np.flatnonzero(edge)
        colour[at] = head[at] = neck[at] = 0.0
        # The four places of all edge pixels, one in each quarter, go through in one piece.
        many = len(SUBSAMPLES)
        offsets = np.repeat(np.array(SUBSAMPLES), len(at), axis=0)
        cols = np.tile(col.ravel()[at], many) + offsets[:, 0]
        rows = np.tile(row.ravel()[at], many) + offsets[:, 1]
        quarter = (np.floor(2 * rows + 1).astype(int), np.floor(2 * cols + 1).astype(int))
        hits = self.cast(self.camera.rays(cols, rows) @ turn)
        hits = self.before(hits, self.owner.plate.fine_depth[quarter])
        source = np.tile(at, many)[hits.index]
        again = self.shade(hits, shadow.ravel()[source])
        # Scattered light is better than plain light: it is taken from the pixel, or from one
        # beside it, whose own ray met the same skin.
        own = np.full(h * w, -1)
        own[first.index] = np.arange(len(first.index))
        waiting = ~again.solid
        for beside in (0, -1, 1, -w, w):
            same = own[np.clip(source + beside, 0, h * w - 1)]
            soft = waiting & (same >= 0) & ~shaded.solid[same]
            soft &= np.abs(first.length[same] - hits.length) < DEPTH_STEP
            again.light[soft] = light[same[soft]]
            waiting &= ~soft
        sub = self.owner.plate.fine_colour[quarter]
        sub[hits.index] = develop(again.albedo * again.light + again.shine)
        colour[at] = sub.reshape(many, len(at), 3).mean(axis=0)
        cover = np.zeros(many * len(at))
        cover[hits.index] = again.part != NECK
        head[at] = cover.reshape(many, -1).mean(axis=0)
        cover[hits.index] = again.part == NECK
        neck[at] = cover.reshape(many, -1).mean(axis=0)
        return colour.reshape(h, w, 3), head.reshape(h, w), neck.reshape(h, w)

    def before(self, hits: Hits, depth: np.ndarray) -> Hits:
        """Hits in front of the shirt, whose depth along each ray is given, cm."""
        forward = -(hits.ray @ self.pose.turn.T)[:, 2]
        return hits.only(hits.length * forward < depth[hits.index])

    def shade(self, hits: Hits, shadow: np.ndarray) -> Shaded:
        return self.owner.materials.shade(hits, self.geometry, shadow, self.view)

    def shadow(self, hits: Hits, shape: tuple[int, int]) -> np.ndarray:
        """How much of the key light arrives, (h, w), blurred from a third of the pixels."""
        h, w = shape
        row, col = np.divmod(hits.index, w)
        chosen = (row % SHADOW_STEP == 0) & (col % SHADOW_STEP == 0)
        small = (-(-h // SHADOW_STEP), -(-w // SHADOW_STEP))
        p = self.pose.eye + hits.ray[chosen] * (hits.length[chosen] - 0.08)[:, None]
        lit = np.zeros(len(p))
        side = np.cross(self.rig.key, self.rig.up)
        side /= np.linalg.norm(side)
        up = np.cross(side, self.rig.key)
        start = np.ascontiguousarray(p + 0.12 * self.rig.key, np.float32)
        for k in range(SHADOW_RAYS):
            a = 2 * np.pi * (k + 0.25) / SHADOW_RAYS
            d = self.rig.key + 0.09 * (np.cos(a) * side + np.sin(a) * up)
            rays = np.tile(d.astype(np.float32), (len(p), 1))
            blocked = self.scene.run(start, rays, query="OCCLUDED") == 0
            blocked |= self.owner.still.run(start, rays, query="OCCLUDED") == 0
            lit += ~blocked
        total, weight = np.zeros(small, np.float32), np.zeros(small, np.float32)
        where = (row[chosen] // SHADOW_STEP, col[chosen] // SHADOW_STEP)
        total[where], weight[where] = lit / SHADOW_RAYS, 1.0
        sigma = 0.16 * self.camera.focal / DISTANCE / SHADOW_STEP + 0.4
        near = cv2.GaussianBlur(weight, (0, 0), sigma)
        smooth = cv2.GaussianBlur(total, (0, 0), sigma) / np.maximum(near, 1e-4)
        grid = np.meshgrid(
            np.arange(w, dtype=np.float32) / SHADOW_STEP,
            np.arange(h, dtype=np.float32) / SHADOW_STEP,
        )
        return cv2.remap(smooth, *grid, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    def scatter(self, shaded: Shaded, hits: Hits, shape: tuple[int, int]) -> np.ndarray:
        """Diffuse light (N, 3) after it spread under the skin."""
        h, w = shape
        skin = np.isin(shaded.part, SCATTERS) & ~shaded.solid
        image = np.zeros((h * w, 3), np.float32)
        mask = np.zeros(h * w, np.float32)
        image[hits.index[skin]] = shaded.light[skin]
        mask[hits.index[skin]] = 1.0
        out = shaded.light.copy()
        for channel, spread in enumerate(SCATTER_CM):
            sigma = spread * self.camera.focal / DISTANCE
            light = cv2.GaussianBlur(image[:, channel].reshape(h, w), (0, 0), sigma)
            weight = cv2.GaussianBlur(mask.reshape(h, w), (0, 0), sigma)
            out[skin, channel] = (light / np.maximum(weight, 1e-4)).ravel()[hits.index[skin]]
        return out


def _edges(label: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(h, w) bool: pixels beside a change of label or a step in depth."""
    edge = np.zeros(label.shape, bool)
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        step = (label[a] != label[b]) | (np.abs(depth[a] - depth[b]) > DEPTH_STEP)
        edge[a] |= step
        edge[b] |= step
    return edge
